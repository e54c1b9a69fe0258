"""What must be in order before a flight, and what is found of it."""
