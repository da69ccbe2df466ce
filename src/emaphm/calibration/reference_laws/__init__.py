"""Laws of a calibration that the averaged model hardly shows: found and fitted by the reference model."""
