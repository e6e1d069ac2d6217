"""The arbiter's mathematics: belief over goals, hindsight optimisation, information gain, action choice.

Pure numpy, no clock, no randomness of its own, no state between calls. Equation numbers refer to
"Balanced Information Gathering and Goal-Oriented Actions in Shared Autonomy" (HRI 2019), section III.

World frame: z up, x forward from the robot's base, y left; metres; directions are unitless with length <= 1.
"""
