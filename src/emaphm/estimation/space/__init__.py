"""The space that a search is in: faults, nuisances, and what deviates of the unit."""
