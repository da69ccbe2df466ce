"""Execution of a model: inputs, plants, compiled kernels and threads."""
