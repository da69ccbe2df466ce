"""Results of studies without running them: errors drawn from distributions like those of the methods."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
import pytest

from emaphm.actuator import Faults
from emaphm.study.store import SCHEMA

CASES = {
    "low F": Faults(friction=0.25),
    "high F": Faults(friction=0.75),
    "low B": Faults(backlash=0.25),
    "high B": Faults(backlash=0.75),
    "low Na": Faults(short_a=0.2),
    "high Na": Faults(short_a=0.8),
    "low K": Faults(eccentricity=0.25),
    "high K": Faults(eccentricity=0.75),
    "low G": Faults(gain=0.25),
    "high G": Faults(gain=0.75),
    "multiple": Faults(0.25, 0.75, 0.8, 0.8, 0.8, 0.25, 0.5, 0.75),
}

METHODS = {
    "GA": (2.6, 4.0),
    "PSO": (1.7, 3.4),
    "DE": (1.4, 2.9),
    "GWO": (1.8, 3.0),
    "DA": (10.0, 3.1),
    "DA (listing)": (16.0, 1.6),
    "hybrid": (0.3, 0.6),
    "hybrid uncorrected": (1.6, 0.1),
    "random": (22.0, 2.8),
}
"""Typical error [%] and time of a run [s]."""

POPULATION = 50


def study(
    methods: Sequence[str] = tuple(METHODS),
    cases: Sequence[str] = tuple(CASES),
    runs: int = 10,
    *,
    seed: int = 0,
    **variant: Any,
) -> pl.DataFrame:
    """Return the runs of a complete study of one variant, in the order of a plan."""
    rng = np.random.default_rng(seed)
    rows = [
        _row(rng, run, case, method, variant) for run in range(runs) for case in cases for method in methods
    ]
    return pl.DataFrame([{"index": i, **row} for i, row in enumerate(rows)], schema=SCHEMA)


def _row(
    rng: np.random.Generator, run: int, case: str, method: str, variant: dict[str, Any]
) -> dict[str, Any]:
    typical, seconds = METHODS.get(method, (5.0, 2.0))
    truth = CASES[case].vector
    harder = 6.0 if case == "multiple" else 1.0
    error = harder * typical * float(rng.lognormal(0, 0.4))
    hybrid = method.startswith("hybrid")
    iterations = 0 if hybrid else 100 if method.startswith("DA") else 200
    evaluations = POPULATION * np.arange(1, iterations + 1)
    decay = np.exp(-np.arange(iterations) / iterations * 4) if iterations else np.empty(0)
    curve = error * (1 + (80 / error) * (decay - decay[-1:].sum()))
    return {
        "group": "",
        "rig": "",
        "case": case,
        "case_kind": "named",
        "method": method,
        "model": "averaged",
        "fitness": "least_squares",
        "equivalent": "torque",
        "noise_A": 0.0,
        "run": run,
        "seed": 1000 + run,
        "truth": truth.tolist(),
        "found": np.clip(truth + error / 300, 0, 1).tolist(),
        "error_percent": error,
        "fitness_value": 0.005 + (error / 100) ** 2,
        "evaluations": int(rng.integers(560, 800)) if hybrid else POPULATION * iterations,
        "reference_runs": 4 if method == "hybrid" else 0,
        "seconds": seconds * float(rng.uniform(0.9, 1.3)),
        "curve_evaluations": evaluations.tolist(),
        "curve_fitness": (0.005 + (curve / 100) ** 2).tolist(),
        "curve_error_percent": curve.tolist(),
        "revision": "0123456789ab",
        "version": "9.8.7",
        **variant,
    }


@pytest.fixture(scope="session")
def runs() -> pl.DataFrame:
    """Return a complete study: nine methods, eleven cases, ten runs each."""
    return study()


@pytest.fixture(scope="session")
def variants() -> pl.DataFrame:
    """Return a study of two variants: without and with sensor noise."""
    methods, cases = ("GA", "DE", "hybrid"), ("low F", "high F", "multiple")
    quiet, noisy = study(methods, cases, 4), study(methods, cases, 4, seed=1, noise_A=0.1)
    return pl.concat([quiet, noisy.with_columns(pl.col("index") + quiet.height)])
