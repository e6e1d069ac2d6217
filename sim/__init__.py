"""The robot and its world: values and geometry (pure), and the adapters that move them."""
