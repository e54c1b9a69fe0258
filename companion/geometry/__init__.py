"""Angles, rotations and rigid transforms. Frames: see docs/frames-and-units.md."""
