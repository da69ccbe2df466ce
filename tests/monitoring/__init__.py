"""Tests of `emaphm.monitoring`, which diagnoses recordings as they arrive."""
