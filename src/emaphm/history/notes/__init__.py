"""Notes on entries of a unit that contradict each other."""
