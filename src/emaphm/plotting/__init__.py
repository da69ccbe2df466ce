"""Figures of results, for `result.plot()` and reports."""
