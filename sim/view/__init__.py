"""The 3-D view of the scene: what is drawn, for whom and from where."""
