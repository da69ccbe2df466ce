"""Whether an estimator can be asked about a recording, and whether its answer is believed."""
