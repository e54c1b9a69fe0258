"""The planar free-flyer: body on air bearings with on/off thrusters, and PX4's spacecraft module around it."""
