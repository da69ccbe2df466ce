"""Tests of `emaphm.diagnosis`."""
