"""Tests of `emaphm.simulation`: each against a reference that does not share its code."""
