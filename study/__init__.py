"""The study engine: what is asked of a participant, what is recorded, and how it is analysed."""
