"""Docking of a small spacecraft: modes, the motion that is to be flown in each, and when to change between them."""
