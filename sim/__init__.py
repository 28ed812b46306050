"""The simulated world: physics, robot models, their drivers, and ground truth."""
