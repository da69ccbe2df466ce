"""Applicability of an estimator: whether it can evaluate a recording, and whether its answer is accepted."""
