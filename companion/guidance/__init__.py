"""Which mode, and why: Markov transition probabilities and the table of modes."""
