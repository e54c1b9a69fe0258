"""Pose of a chaser against a mother-ship from gyro, radio ranges and markers in the picture (Parikh et al.)."""
