"""Uncertainty of an estimate: information, covariance, and parameters identifiable only in combination."""
