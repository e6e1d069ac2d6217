"""What every arbiter, goal inference and robot promises, as tests that its author runs with one line."""
