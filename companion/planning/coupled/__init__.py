"""Position and heading that depend on each other: a rover's motion by sequential convex programming."""
