"""The stages of a training, in the order in which they follow each other."""
