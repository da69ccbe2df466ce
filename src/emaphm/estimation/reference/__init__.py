"""Estimation with the reference model itself, where the corrected averaged model is not accurate enough."""
