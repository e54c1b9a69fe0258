"""Configuration files: schema, defaults, checks."""
