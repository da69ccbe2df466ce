"""The study: plans, execution, statistics, report."""
