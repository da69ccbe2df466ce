"""Uncertainty of one unit's description: tolerances, covariance after a calibration, and model error."""
