"""Comparison of identification methods over many cases: plans, execution, tables."""

from emaphm.study.plan import BUILT_IN, Plan
from emaphm.study.run import run_study
from emaphm.study.store import Store

__all__ = ["BUILT_IN", "Plan", "Store", "run_study"]
