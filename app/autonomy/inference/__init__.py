"""Ways to infer the goal from what the person does, one file each."""
