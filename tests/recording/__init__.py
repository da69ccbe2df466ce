"""Tests of `emaphm.recording`."""
