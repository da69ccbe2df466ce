"""The stages of a training, from the answering networks to the finished estimator."""
