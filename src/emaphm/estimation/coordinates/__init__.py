"""The coordinates of an estimate: faults, nuisances, and what deviates of the unit."""
