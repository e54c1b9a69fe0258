"""Feedback on the pose relative to the target."""
