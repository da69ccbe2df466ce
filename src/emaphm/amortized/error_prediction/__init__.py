"""Predicted error of an answer, from what the averaged model at the answer leaves of the recording."""
