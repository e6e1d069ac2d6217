"""Importing this connects to pybullet's physics: processes that are forked from one which has imported it share the
memory of a connection that nobody has used."""

from sim.bullet import CONNECTIONS

CONNECTIONS.make_ready()
