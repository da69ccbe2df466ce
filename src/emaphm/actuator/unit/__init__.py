"""What is known of one unit beyond its description: tolerances, what a calibration found, and its error."""
