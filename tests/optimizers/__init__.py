"""Tests of `emaphm.optimizers`."""
