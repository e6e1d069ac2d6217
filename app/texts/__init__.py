"""Which texts participants may read, where each stands in the sources, and what a translation of them lacks."""
