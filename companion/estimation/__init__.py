"""The target relative to the observer: ownship history, measurement model, EKF, consistency."""
