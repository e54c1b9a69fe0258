"""A rover's pilot: how rover and target move, where a plan begins, the plan, and what is driven of it."""
