"""The presets by name; what each changes in a study file stands in `app.simulated.variants`.

A module of its own, so that the command line knows the names without loading what they lead to.
"""

from __future__ import annotations

PRESET_NAMES = ("paper", "lab", "fitted")
"""`paper`: 1 per metre. `lab`: the shipped study's. `fitted`: as calibrated on the paper's pure teleoperation."""
