"""Shared Autonomy Lab: the running study, its arbiter and its web front."""
