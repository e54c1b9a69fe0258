"""The stub beside recordings of PX4: the same inputs, the same measures, one table."""
