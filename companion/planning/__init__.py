"""Trajectories: minimum snap and minimum acceleration, scaled in time until the limits hold."""
