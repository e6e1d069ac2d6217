"""Proof that what was recorded is what is there: contents by their hash, and the chain of everything written."""
