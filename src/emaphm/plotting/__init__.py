"""Figures of results, drawn when asked for: by `result.plot()`, or for a report."""
