"""Where the target will be, and when and where it can be met."""
