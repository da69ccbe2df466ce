"""Tests of `emaphm.experiment`."""
