"""The data that flows between packages.

Frozen, every field documented, SI units, time `t` in seconds of the companion's clock.
"""
