"""Mission files: schema and checks."""
