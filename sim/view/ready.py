"""Importing this makes the lab's own look: processes that are forked from one which has imported it have it at once."""

from sim.view.looks import own_look

own_look()
