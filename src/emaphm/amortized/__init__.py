"""Estimators trained on an actuator's own simulations: milliseconds in place of a search."""

from emaphm.amortized.estimator import Estimator

__all__ = ["Estimator"]
