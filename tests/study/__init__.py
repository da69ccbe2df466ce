"""Tests of `emaphm.study`: plans, execution, statistics and reports."""
