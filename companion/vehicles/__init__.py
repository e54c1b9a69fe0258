"""What each kind of vehicle can do."""
