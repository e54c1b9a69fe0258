"""Docking of a spacecraft that has no autopilot: estimator, guidance and control in one synchronous step."""
