"""Baseline predictions: last slope, one Kalman filter per component, and lives of the fleet."""

from collections.abc import Sequence

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.prognosis import Evidence, Limit, Requirements
from emaphm.prognosis.columns import columns_of, level_of
from emaphm.random_streams import stream

LAST = 10
"""Number of diagnoses for the last slope."""

PATHS = 1000

LONGEST_H = 20_000.0
"""Longest predicted life [h], as in the forecasts of emaphm."""

RATE = 3e-4
"""Prior standard deviation of a rate in the filter of one component [1/h]: a limit of 0.6 in 2,000 h, as a
user would read from such a fleet."""

LEVEL_NOISE, RATE_NOISE = 0.02 / np.sqrt(2000.0), 0.3 * RATE / np.sqrt(2000.0)
"""Process noise of this filter [1/√h], [1/h/√h]: in 2,000 h, a level drifts by 0.02, a rate by 30 %."""


def last_slope(evidence: Evidence, actuator: Actuator) -> Array:
    """Return the RUL [h], (1,), by straight lines through the last levels of each component; may be `inf`."""
    last = evidence.used[-LAST:]
    hours = np.array([diagnosis.hours for diagnosis in last])
    shortest = np.inf
    for limit in Requirements(actuator).limits:
        level = np.array([_value(diagnosis.level, limit) for diagnosis in last])
        if hours.size < 2:
            continue
        slope, offset = np.polyfit(hours - evidence.hours, level, 1)
        towards = slope if limit.upper else -slope
        if towards > 0:
            shortest = min(
                shortest, max(limit.bound - offset if limit.upper else offset - limit.bound, 0.0) / towards
            )
    return np.array([shortest if shortest < LONGEST_H else np.inf])


def one_filter_a_component(evidence: Evidence, actuator: Actuator, seed: int) -> Array:
    """Return a sample of the RUL [h], (`PATHS`,), by a Kalman filter of level and rate for each component.

    In the manner of `progpy`: one model per component, level and rate with manually chosen process noise, the
    variance of each diagnosis without covariances between components, prediction by Monte Carlo simulation.
    The RUL of the unit is the shortest of its components, which are assumed to be independent.
    """
    random = stream(seed, "one filter a component", evidence.unit)
    lives = [
        _first_passage(*_filtered(evidence, limit), limit, random) for limit in Requirements(actuator).limits
    ]
    return np.asarray(np.min(lives, axis=0))


def mean_life(hours: float, lives: Sequence[float]) -> Array:
    """Return the RUL [h], (1,), by the mean life of the other units with lives longer than `hours`."""
    return np.array([np.mean(fleet_lives(hours, lives))])


def fleet_lives(hours: float, lives: Sequence[float]) -> Array:
    """Return the RUL [h], (n,), by the lives of the other units that lived longer than `hours`; 0 if none."""
    return np.array([life - hours for life in lives if life > hours] or [0.0])


def _value(level: Array, limit: Limit) -> float:
    return float(level_of(level, str(limit.component)))


def _variance(covariance: Array, limit: Limit) -> float:
    column = columns_of(str(limit.component))[0]
    return float(covariance[column, column])


def _filtered(evidence: Evidence, limit: Limit) -> tuple[Array, Array]:
    """Return mean (2,) and covariance (2, 2) of level and rate at the present hours."""
    healthy = 0.5 if limit.component == "gain" else 0.0
    mean, covariance, at = np.array([healthy, 0.0]), np.diag([0.03**2, RATE**2]), 0.0
    for diagnosis in evidence.used:
        mean, covariance = _propagated(mean, covariance, diagnosis.hours - at)
        at = diagnosis.hours
        gain = covariance[:, 0] / (covariance[0, 0] + _variance(diagnosis.covariance, limit))
        mean = mean + gain * (_value(diagnosis.level, limit) - mean[0])
        covariance = covariance - np.outer(gain, covariance[0])
    return _propagated(mean, covariance, evidence.hours - at)


def _propagated(mean: Array, covariance: Array, hours: float) -> tuple[Array, Array]:
    step = np.array([[1.0, hours], [0.0, 1.0]])
    noise = LEVEL_NOISE**2 * np.diag([hours, 0.0]) + RATE_NOISE**2 * np.array(
        [[hours**3 / 3, hours**2 / 2], [hours**2 / 2, hours]]
    )
    return step @ mean, step @ covariance @ step.T + noise


def _first_passage(mean: Array, covariance: Array, limit: Limit, random: np.random.Generator) -> Array:
    level, rate = random.multivariate_normal(mean, covariance, PATHS, method="eigh").T
    life = np.where(limit.margin(level) <= 0, 0.0, np.inf)
    hours, step = 0.0, 20.0
    while hours < LONGEST_H and np.isinf(life).any():
        rate = rate + RATE_NOISE * np.sqrt(step) * random.standard_normal(PATHS)
        level = level + rate * step + LEVEL_NOISE * np.sqrt(step) * random.standard_normal(PATHS)
        hours += step
        life = np.where(np.isinf(life) & (limit.margin(level) <= 0), hours, life)
    return life
