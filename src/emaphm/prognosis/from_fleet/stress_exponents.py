"""Exponents of the stress for the components of a new unit, from the other units of its part number.

The filter of one unit estimates the exponents of a component badly: loads and temperatures differ little
between its flights, and a wrong law looks like an effect of stress. But exponents depend on the design of the
component, so that they differ little between units.

Between two diagnoses of a unit, the logarithm of the rate of a level is y = ln ρ + β·z, with the rate ρ at
the reference stress and the covariates z. By any law, ρ changes little from one interval to the next, so that
β follows from the differences between successive intervals, Δy = β·Δz + e. The regression is robust, because
ρ does change at an onset.

Over the units, the exponent of a component is normal with mean μ and standard deviation τ (random effects),
within the range of the general prior. Both are estimated from the regressions of all units.
"""

from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES, COMPONENTS
from emaphm.arrays import Array
from emaphm.prognosis.columns import ECCENTRICITY, columns_of, level_of
from emaphm.prognosis.evidence import Evidence, Observation
from emaphm.prognosis.stress import STRESSES, StressReference, exposure

LEAST_CHANGE = 5.0
"""Least usual change of a level between two diagnoses, in standard errors: the logarithm of smaller changes
is biased."""

HUBER = 1.345
"""Residual in standard deviations above which a difference has less weight: 95 % efficiency (Huber 1964)."""

CORRELATION = 5 / 3
"""Variance of an estimate, relative to one from independent differences. Successive differences share an
interval, and have the correlations -2/3 and 1/6 for errors of the levels; those of covariates that are
independent from interval to interval have -1/2. The variance is then larger by 1 + 2 (2/3) (1/2)."""

ROUNDS = 10
"""Rounds of the robust regression."""

BINS = 40
"""Number of equal intervals of the range of an exponent."""

SPREADS = (0.02, 0.04, 0.08, 0.16, 0.32)
"""Standard deviations τ between units as shares of the range, equally probable."""

MISFIT = 0.05
"""Probability that the regression of a unit is wrong."""


class ExponentEstimates(NamedTuple):
    """Exponents of one unit by regression: means and precisions, (components, covariates) each.

    A precision of 0 means that the unit does not determine the exponent.
    """

    mean: Array
    precision: Array


def exponents_of_unit(
    unit: Evidence, reference: StressReference, ranges: Sequence[tuple[float, float]]
) -> ExponentEstimates:
    """Return the estimates from one unit; the other covariates of a component are uncertain in `ranges`."""
    low, high = np.array(ranges).T
    middle, general = (low + high) / 2, 12 / (high - low) ** 2
    mean = np.tile(middle, (len(CARTESIAN_NAMES), 1))
    precision = np.zeros(mean.shape)
    for component in COMPONENTS:
        columns = columns_of(component)
        differences = [_differences(unit, component, life, reference) for life in unit.lives(columns[0])]
        information, weighted = _regression(*map(np.concatenate, zip(*differences, strict=True)))
        covariance = np.linalg.inv(information + np.diag(general))
        marginal = np.diag(covariance)
        # The prior of the exponent itself is taken out again; that of the other exponents remains.
        from_data = np.maximum(1 / marginal - general, 0.0)
        shifted = covariance @ (weighted + general * middle) / marginal - general * middle
        known = from_data > 1e-6 * general
        precision[columns] = np.where(known, from_data, 0.0)
        mean[columns] = np.where(known, shifted / np.where(known, from_data, 1.0), middle)
    return ExponentEstimates(mean, precision)


def exponents_of_new_unit(
    of_units: Sequence[ExponentEstimates],
    filtered: Array,
    ranges: Sequence[tuple[float, float]],
    random: np.random.Generator,
) -> Array:
    """Return draws of the exponents of a new unit, (n, components, covariates).

    Parameters
    ----------
    of_units
        Estimates of the other units by regression.
    filtered
        Draws from the filters of these units, in the shape of the result. They are returned for an exponent
        of which they have the smaller standard deviation: a regression needs changes of the level that are
        larger than the errors of single diagnoses.
    ranges
        Range of the general prior of each covariate's exponent.
    random
        Source of the draws.
    """
    low, high = np.array(ranges).T
    mean = (np.stack([unit.mean for unit in of_units]) - low) / (high - low)
    precision = np.stack([unit.precision for unit in of_units]) * (high - low) ** 2
    cumulative = np.cumsum(_predicted(mean, precision), axis=-1)
    uniform = random.random(filtered.shape)
    interval = np.sum(uniform[..., np.newaxis] > cumulative[..., :-1], axis=-1)
    drawn = low + (interval + random.random(interval.shape)) / BINS * (high - low)
    drawn[:, ECCENTRICITY[1]] = drawn[:, ECCENTRICITY[0]]
    return np.where(np.std(drawn, axis=0) < np.std(filtered, axis=0), drawn, filtered)


def _predicted(mean: Array, precision: Array) -> Array:
    """Return the probabilities of intervals for a new unit, (…, `BINS`), from units (n, …), all in ranges.

    The likelihood of μ and τ is the product over the units of ∫ N(θ; mean, 1 / precision) p(θ; μ, τ) dθ, with
    a uniform prior over a grid.
    """
    centre = (np.arange(BINS) + 0.5) / BINS
    grid = np.array([(middle, spread) for middle in centre for spread in SPREADS])
    population = np.exp(-0.5 * ((centre - grid[:, :1]) / grid[:, 1:]) ** 2)
    population /= population.sum(axis=1, keepdims=True)
    distance = centre - mean[..., np.newaxis]
    likelihood = np.exp(-0.5 * precision[..., np.newaxis] * distance**2)
    likelihood /= np.maximum(likelihood.mean(axis=-1, keepdims=True), 1e-300)
    likelihood = MISFIT + (1 - MISFIT) * likelihood
    log_likelihood = np.log(likelihood @ population.T).sum(axis=0)
    weight = np.exp(log_likelihood - log_likelihood.max(axis=-1, keepdims=True))
    return np.asarray(weight @ population / weight.sum(axis=-1, keepdims=True))


def _differences(
    unit: Evidence, component: str, life: tuple[float, float], reference: StressReference
) -> tuple[Array, Array, Array]:
    """Return Δy (n,) between successive intervals of one life, Δz (n, covariates), and variances (n,)."""
    new_at, until = life
    column = columns_of(component)[0]
    diagnoses = [one for one in unit.used if new_at < one.hours <= until and one.seen[column]]
    intervals = list(_intervals(unit, _flights(diagnoses, component), reference))
    pairs = [(first, second) for first, second in pairwise(intervals) if first and second]
    y = np.array([second[0] - first[0] for first, second in pairs])
    z = np.array([second[1] - first[1] for first, second in pairs]).reshape(y.size, len(STRESSES))
    return y, z, np.array([second[2] + first[2] for first, second in pairs])


class _Flights(NamedTuple):
    """Flight hours (m,) [h] of a unit, its mean level on each flight (m,), and the variance (m,)."""

    hours: Array
    level: Array
    variance: Array


def _flights(diagnoses: Sequence[Observation], component: str) -> _Flights:
    """Return the flights of diagnoses, which are by hours; recordings of one flight have the same hours."""
    columns = columns_of(component)
    flights = [list(of_flight) for _, of_flight in groupby(diagnoses, key=lambda one: one.hours)]
    level = [level_of(np.mean([one.level for one in each], axis=0), component) for each in flights]
    variance = [
        np.mean([np.diag(one.covariance)[columns].max() for one in each]) / len(each) for each in flights
    ]
    return _Flights(np.array([each[0].hours for each in flights]), np.array(level), np.array(variance))


def _intervals(
    unit: Evidence, flights: _Flights, reference: StressReference
) -> Iterator[tuple[float, Array, float] | None]:
    """Yield y, z and the variance of y between successive flights; None if the level changes too little."""
    level, variance = flights.level, flights.variance
    change = np.diff(level) * (1 if level.size == 0 or level[-1] >= level[0] else -1)
    error = np.sqrt(variance[1:] + variance[:-1])
    for i, (before, after) in enumerate(pairwise(flights.hours.tolist())):
        # A selection by the change itself would leave out intervals of little stress.
        usual = np.median(change[max(i - 2, 0) : i + 3])
        if change[i] <= error[i] or usual < max(LEAST_CHANGE * error[i], 1e-9):
            yield None
            continue
        flown = exposure(unit.stresses, reference, before, after)
        hours = after - before
        rate = float(np.log(change[i] / hours))
        yield rate, flown.hours @ flown.covariates / hours, float((error[i] / change[i]) ** 2)


def _regression(y: Array, z: Array, variance: Array) -> tuple[Array, Array]:
    """Return the information matrix of β and its product with the estimate, by a robust regression.

    Residuals have the stated `variance` of the diagnoses and a further one, which is estimated.
    """
    count = z.shape[1]
    varies = np.ptp(z, axis=0) > 0 if y.size else np.zeros(count, bool)
    freedom = y.size - int(varies.sum())
    if not varies.any() or freedom < 3:
        return np.zeros((count, count)), np.zeros(count)
    weight, chosen = np.ones(y.size), z[:, varies]
    for _ in range(ROUNDS):
        information = chosen.T @ (weight[:, np.newaxis] * chosen)
        beta = np.linalg.lstsq(information, chosen.T @ (weight * y), rcond=None)[0]
        residual = y - chosen @ beta
        # The median of |e| of a normal distribution is 0.6745 standard deviations.
        spread = (np.median(np.abs(residual)) / 0.6745) ** 2 * y.size / freedom
        total = variance + max(spread - float(np.median(variance)), 0.0)
        excess = np.abs(residual) / np.sqrt(total)
        weight = np.minimum(1.0, HUBER / np.maximum(excess, 1e-9)) / total
    # Student's t with few degrees of freedom is wider than a normal distribution.
    information = chosen.T @ (weight[:, np.newaxis] * chosen) * (freedom - 2) / freedom / CORRELATION
    result, weighted = np.zeros((count, count)), np.zeros(count)
    result[np.ix_(varies, varies)], weighted[varies] = information, information @ beta
    return result, weighted
