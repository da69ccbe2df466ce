"""What advances a model: kernels, plants, inputs, running."""
