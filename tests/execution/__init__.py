"""Tests of `emaphm.execution`."""
