"""Tests of `emaphm.estimation`."""
