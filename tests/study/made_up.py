"""Made-up results of trials: small errors, intervals that hold the truth, and correct verdicts."""

from collections.abc import Callable
from typing import Any

import polars as pl

from emaphm.study import Plan
from emaphm.study.store import SCHEMA, identity
from emaphm.study.trials import Trial, trials_of

HEALTHY = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5]


def row(trial: Trial, **values: Any) -> dict[str, Any]:
    """Return a made-up result: a small error, intervals that hold the truth, and each fault degraded."""
    verdicts = ["degraded" if v != h else "healthy" for v, h in zip(trial.truth, HEALTHY, strict=True)]
    return {
        **identity(trial),
        "found": list(trial.truth),
        "fitness_value": 1e-3,
        "evaluations": 1000,
        "reference_runs": 32,
        "seconds": 0.1,
        "curve_evaluations": [],
        "curve_fitness": [],
        "curve_error_percent": [],
        "lower95": [v - 0.01 for v in trial.truth],
        "upper95": [v + 0.01 for v in trial.truth],
        "standard_error": [0.005] * 8,
        "verdict": verdicts,
        "explained": True,
        "moves": True,
        "revision": "0123456789ab",
        "version": "9.8.7",
        "error_percent": 0.2,
        "wall_seconds": 0.2,
        "cpu_seconds": 0.2,
        **values,
    }


def unchanged(_: Trial) -> dict[str, Any]:
    return {}


def results(
    plan: Plan, share: float = 0.1, change: Callable[[Trial], dict[str, Any]] = unchanged
) -> pl.DataFrame:
    return pl.DataFrame([row(trial, **change(trial)) for trial in trials_of(plan, share)], schema=SCHEMA)
