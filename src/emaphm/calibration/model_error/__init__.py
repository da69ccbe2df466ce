"""Error of a calibrated model, learned from recordings that were left out of the fit."""
