"""Notes on entries of a unit that do not agree with each other."""
