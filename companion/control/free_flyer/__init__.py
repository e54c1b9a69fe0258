"""Position and heading control of a planar free-flyer: from a reference to attitude and body thrust."""
