"""The vehicle half: rigid body, estimate that wanders, PX4-like controllers and autopilot."""
