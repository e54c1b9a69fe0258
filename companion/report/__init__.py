"""The picture of a flight."""
