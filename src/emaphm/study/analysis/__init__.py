"""What the runs of a study show: statistics, ranks, convergence, tables."""
