"""Laws that have little effect in the averaged model: calibrated with the reference model."""
