"""The world without the vehicle: camera and targets for an autopilot that runs elsewhere."""
