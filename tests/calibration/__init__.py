"""Tests of `emaphm.calibration`."""
