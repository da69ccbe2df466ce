"""Analysis of the runs of a study: statistics, ranks, convergence, tables."""
