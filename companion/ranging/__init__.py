"""Ranges to anchors from real hardware: survey of the anchors, wire formats, and the source that delivers readings."""
