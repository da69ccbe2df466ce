"""Rates of the diagnoses of a study: coverage of intervals, false alarms, detection.

`rows` are finished trials with a diagnosis (`emaphm.study.store.SCHEMA`), one row per trial.
"""

import numpy as np
import polars as pl
from numpy.typing import ArrayLike
from scipy.special import bdtr

from emaphm.actuator.faults import COMPONENTS, HEALTHY, NAMES, whole_turns
from emaphm.arrays import Array, Flags

CHANCE = 1e-3
"""Probability that the coverage of true 95 % intervals is below `least_by_chance`."""

_DEGRADING = [NAMES.index(name) for name in COMPONENTS]


def errors(rows: pl.DataFrame) -> Array:
    """Return the errors of the fault vectors [%], shape (n,)."""
    return rows["error_percent"].to_numpy()


def quantiles(errors: Array) -> str:
    """Return the median, the 95th percentile and the maximum of `errors` [%] as text for pages."""
    return f"{np.median(errors):.2f} / {np.percentile(errors, 95):.2f} / {errors.max():.2f}"


def holds(name: str, interval: tuple[ArrayLike, ArrayLike], truth: ArrayLike) -> Flags:
    """Return whether the `interval` of a component contains the `truth` (any shape).

    The phase is a direction, equal after a whole turn, and its interval may extend beyond 0 or 1, where the
    circle closes. All other components are sizes, for which 0 and 1 are the farthest apart.
    """
    low, high = (np.asarray(end, float) for end in interval)
    equivalents = [np.asarray(truth, float) + turn for turn in whole_turns(name)]
    return np.asarray(np.any([(low <= value) & (value <= high) for value in equivalents], axis=0))


def covered(rows: pl.DataFrame) -> Flags:
    """Return whether the 95 % interval of each component contains the truth, shape (n, 8)."""
    truth, low, high = (_vectors(rows, name).T for name in ("truth", "lower95", "upper95"))
    return np.column_stack([holds(name, (low[i], high[i]), truth[i]) for i, name in enumerate(NAMES)])


def coverage(rows: pl.DataFrame) -> Array:
    """Return the share of the trials whose interval contains the truth, by component, shape (8,)."""
    return np.asarray(covered(rows).mean(axis=0))


def half_widths(rows: pl.DataFrame) -> Array:
    """Return the half-widths of the 95 % intervals, shape (n, 8)."""
    return np.asarray((_vectors(rows, "upper95") - _vectors(rows, "lower95")) / 2)


def alarms(rows: pl.DataFrame) -> Flags:
    """Return whether each of `COMPONENTS` was called degraded, shape (n, 7)."""
    verdicts = np.array(rows["verdict"].to_list(), dtype=str).reshape(-1, len(NAMES))
    return np.asarray(verdicts == "degraded")[:, _DEGRADING]


def faulty(rows: pl.DataFrame) -> Flags:
    """Return whether each of `COMPONENTS` has a fault, shape (n, 7)."""
    return np.asarray(_vectors(rows, "truth") != HEALTHY.vector)[:, _DEGRADING]


def detection(rows: pl.DataFrame) -> float:
    """Return the share of the faulty components that were called degraded."""
    return float(alarms(rows)[faulty(rows)].mean())


def false_alarms(rows: pl.DataFrame) -> float:
    """Return the share of the healthy components that were called degraded."""
    return float(alarms(rows)[~faulty(rows)].mean())


def recordings_alarmed(rows: pl.DataFrame) -> float:
    """Return the share of the recordings with any component called degraded."""
    return float(alarms(rows).any(axis=1).mean())


def explained(rows: pl.DataFrame) -> float:
    """Return the share of the recordings that are called explained."""
    return float(rows["explained"].to_numpy().mean())


def single_fault(truth: list[float]) -> tuple[str, float]:
    """Return the kind and the size of a small single fault, as in `emaphm.study.cases.small_fault`."""
    deviation = np.abs(np.asarray(truth) - HEALTHY.vector)[_DEGRADING]
    name = COMPONENTS[int(deviation.argmax())]
    return "short" if name.startswith("short") else name, round(float(deviation.max()), 6)


def least_by_chance(count: int) -> float:
    """Return the lower limit of the observed coverage of true 95 % intervals in `count` cases.

    The smallest k / count with P(at most k of `count` covered) ≥ `CHANCE`.
    """
    covered_counts = np.arange(count + 1)
    return float(np.argmax(bdtr(covered_counts, count, 0.95) >= CHANCE)) / count


def chance_interval(count: int) -> tuple[float, float]:
    """Return the 95 % range of the observed coverage of true 95 % intervals in `count` cases."""
    cumulative = bdtr(np.arange(count + 1), count, 0.95)
    low, high = (int(np.argmax(cumulative >= level)) for level in (0.025, 0.975))
    return low / count, high / count


def _vectors(rows: pl.DataFrame, name: str) -> Array:
    return np.array(rows[name].to_list(), dtype=float).reshape(-1, len(NAMES))
