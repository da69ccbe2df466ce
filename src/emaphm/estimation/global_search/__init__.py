"""Global search of the parameter space for the basin of the optimum."""
