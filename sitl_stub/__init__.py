"""A PX4-like vehicle and a world with targets and a camera. Imports nothing of the companion."""
