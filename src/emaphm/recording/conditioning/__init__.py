"""From what a file holds to what a recording may hold: one time base, gaps, outliers, bandwidth, each noted."""
