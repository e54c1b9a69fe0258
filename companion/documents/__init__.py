"""YAML documents with the place of every value: all errors at once, with file, line and column."""
