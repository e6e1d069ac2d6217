"""How many people a machine holds: measured with scripted ones, told with a margin, and kept for the lab."""
