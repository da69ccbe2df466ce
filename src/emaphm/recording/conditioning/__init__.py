"""From what a file holds to a recording: one time base, gaps, outliers, bandwidth, each noted."""
