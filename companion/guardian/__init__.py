"""The only sender of setpoints: samples, limits, brakes, hands over."""
