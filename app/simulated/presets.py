"""The presets by name; what each changes in a study file stands in `app.simulated.variants`.

A module of its own, so that the command line knows the names without loading what they lead to.
"""

from __future__ import annotations

PRESET_NAMES = ("shipped", "paper", "lab", "fitted", "ahead", "at_rest", "averaged", "steady")
"""`shipped`: the study that ships, as it stands. `lab`: the one that shipped first. `paper`: that one with 1 per metre.
`fitted`: the first fit to the paper's pure teleoperation. `ahead`, `at_rest`, `averaged`: the study that ships, with
information looked at elsewhere than in the paper. `steady`: the study that ships, with an arm that seldom turns
back."""
