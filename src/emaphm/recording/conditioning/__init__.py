"""Conditioning of a file's columns: time base, gaps, outliers, bandwidth; each step adds a note."""
