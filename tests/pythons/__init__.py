"""The other Pythons, and other systems: `make test-pythons`."""
