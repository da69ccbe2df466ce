"""Running a model: its inputs, plants, kernels and threads."""
