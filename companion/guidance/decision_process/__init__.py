"""The switching decision as a Markov decision process: learned from logged approaches, solved, kept as a table."""
