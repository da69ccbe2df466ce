"""Tests of `emaphm.history`."""
