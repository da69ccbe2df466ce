"""Parameter space of a search: faults, nuisances, and deviations of the unit's parameters."""
