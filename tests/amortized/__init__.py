"""Tests of the estimators that are trained on simulations."""
