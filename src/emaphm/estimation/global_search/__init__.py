"""From anywhere in the range to the basin of the optimum."""
