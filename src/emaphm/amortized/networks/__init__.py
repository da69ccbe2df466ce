"""The networks of an estimator: dense layers, their training by PyTorch, mixtures and projections."""
