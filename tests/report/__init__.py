"""Tests of `emaphm.report` and of its figures."""
