"""Reading and writing of an estimator's file."""
