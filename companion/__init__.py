"""Vision-guided flight on PX4: find a target with one camera, track it, predict it, meet it and land on it."""
