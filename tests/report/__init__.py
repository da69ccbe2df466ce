"""Tests of `emaphm.report` and of the figures that it shows."""
