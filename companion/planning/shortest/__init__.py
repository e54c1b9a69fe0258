"""Shortest paths of a car, the time they take, and where a moving place can be met."""
