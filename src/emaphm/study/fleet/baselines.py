"""What a user would otherwise take: the last slope, one filter a component, the lives of the fleet."""

from collections.abc import Sequence

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.prognosis import Evidence, Limit, Requirements
from emaphm.prognosis.columns import columns_of, level_of
from emaphm.random_streams import stream

LAST = 10
"""Diagnoses that the last slope is taken from."""

PATHS = 1000

LONGEST_H = 20_000.0
"""How far is looked [h], as in our forecasts."""

RATE = 3e-4
"""Standard deviation of a rate before it is seen, of the filter of one component [1/h]: a limit of 0.6 in
2,000 h, as a user would read from such a fleet."""

LEVEL_NOISE, RATE_NOISE = 0.02 / np.sqrt(2000.0), 0.3 * RATE / np.sqrt(2000.0)
"""Process noise of that filter: a level strays by 0.02 in 2,000 h, a rate by 30 % [1/√h], [1/h/√h]."""


def last_slope(evidence: Evidence, actuator: Actuator) -> Array:
    """Return the RUL [h], (1,), by a straight line through each component's last diagnoses; `inf` if none."""
    last = evidence.used[-LAST:]
    hours = np.array([one.hours for one in last])
    shortest = np.inf
    for limit in Requirements(actuator).limits:
        level = np.array([_value(one.level, limit) for one in last])
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

    As one would do with `progpy`: one model a component, level and rate with process noise chosen by hand,
    each diagnosis's variance and no covariance between components, prediction by Monte Carlo simulation.
    The unit's RUL is the shortest of its components', taken as independent.
    """
    random = stream(seed, "one filter a component", evidence.unit)
    lives = [
        _first_passage(*_filtered(evidence, limit), limit, random) for limit in Requirements(actuator).limits
    ]
    return np.asarray(np.min(lives, axis=0))


def mean_life(hours: float, lives: Sequence[float]) -> Array:
    """Return the RUL [h], (1,), by the mean life of those other units that have lived longer than `hours`."""
    return np.array([np.mean(fleet_lives(hours, lives))])


def fleet_lives(hours: float, lives: Sequence[float]) -> Array:
    """Return the RUL [h], (n,), by the lives of those other units that have lived longer than `hours`.

    0 where none has.
    """
    return np.array([life - hours for life in lives if life > hours] or [0.0])


def _value(level: Array, limit: Limit) -> float:
    return float(level_of(level, str(limit.component)))


def _variance(one_covariance: Array, limit: Limit) -> float:
    column = columns_of(str(limit.component))[0]
    return float(one_covariance[column, column])


def _filtered(evidence: Evidence, limit: Limit) -> tuple[Array, Array]:
    """Return mean (2,) and covariance (2, 2) of level and rate now."""
    healthy = 0.5 if limit.component == "gain" else 0.0
    mean, covariance, at = np.array([healthy, 0.0]), np.diag([0.03**2, RATE**2]), 0.0
    for one in evidence.used:
        mean, covariance = _moved(mean, covariance, one.hours - at)
        at = one.hours
        gain = covariance[:, 0] / (covariance[0, 0] + _variance(one.covariance, limit))
        mean = mean + gain * (_value(one.level, limit) - mean[0])
        covariance = covariance - np.outer(gain, covariance[0])
    return _moved(mean, covariance, evidence.hours - at)


def _moved(mean: Array, covariance: Array, hours: float) -> tuple[Array, Array]:
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
