"""Predicted error of an answer, from the residual of the averaged model at the answer."""
