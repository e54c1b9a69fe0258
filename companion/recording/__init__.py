"""Recordings of a flight: writing and reading."""
