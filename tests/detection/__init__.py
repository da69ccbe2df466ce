"""Tests of `emaphm.detection`."""
