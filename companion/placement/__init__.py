"""Where ranging anchors should stand: what a set-up lets a chaser know of its place, and better places for them."""
