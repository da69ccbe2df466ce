"""The particle filter of the degradation: prediction, update, resampling."""
