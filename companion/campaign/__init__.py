"""Many simulated flights: scoring, seeds, tables."""
