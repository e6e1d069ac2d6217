"""What one system's disk does differently from another's: locks, what is really written, whose files they are."""
