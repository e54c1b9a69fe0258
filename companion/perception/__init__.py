"""From pixels to the pad's pose: camera model, tag detection, corner refinement, joint square PnP."""
