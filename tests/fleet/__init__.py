"""Tests of `emaphm.fleet`."""
