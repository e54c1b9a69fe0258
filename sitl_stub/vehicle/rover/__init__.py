"""A rover with Ackermann steering and PX4's rover_ackermann controllers."""
