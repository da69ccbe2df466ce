"""An estimator in one file."""
