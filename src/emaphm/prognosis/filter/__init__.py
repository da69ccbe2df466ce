"""Particle filter of the degradation: prediction, update, resampling."""
