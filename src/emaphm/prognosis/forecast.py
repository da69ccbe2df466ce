"""Forecast of a unit: states drawn from the filter, and paths of its levels from now on."""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.bounds import BEYOND, bounds, within_bounds
from emaphm.prognosis.filter.degradation import LARGEST_RATE
from emaphm.prognosis.filter.resampling import drawn_rows, recombined, systematic
from emaphm.prognosis.laws import (
    Numbers,
    breaks,
    in_common,
    is_moving,
    is_waiting,
    keeps_rate,
    noise_rates,
    onsets,
    transition,
)
from emaphm.prognosis.prior import Prior, replace_law_fields, with_rows
from emaphm.prognosis.settings import FORECAST, ForecastSettings
from emaphm.random_streams import stream

SINGULAR = (1e-9, 1e-6, 1e-3)
"""Values added to the diagonals of correlation matrices, tried in turn until these are positive definite."""


@dataclass(frozen=True, eq=False)
class UnitDraws:
    """Sampled states of a unit: hypotheses as in `Hypotheses`, level [-], rate [1/h], (n, 8) each.

    `aged` are the hours [h] at the reference stress since each component was new; `exponents` (n, 8, 3).
    """

    aged: Array
    exponents: Array
    law: Numbers
    life_scale: Array
    shape: Array
    roughness: Array
    unevenness: Array
    level: Array
    rate: Array


@dataclass(frozen=True, eq=False)
class Paths:
    """Levels on n paths from now on: `hours` (m,) [h], the first 0; `level` (m, n, 8).

    `noise` is the standard deviation of each level's Wiener process in each step [1/√h], (m - 1, n, 8).
    """

    hours: Array
    level: Array
    noise: Array


def drawn_states(belief: Belief, count: int) -> UnitDraws:
    """Return `count` equally weighted states, drawn from the filter state given that levels are in bounds.

    The shared covariance of the diagnoses is added to that of the levels.
    The filter has no bounds, because a constraint applied at each update would be counted repeatedly. Bounds
    are applied once, exactly: each level is drawn within its bounds given the levels before it, and the state
    is weighted by the probabilities of these bounds (Geweke, Hajivassiliou, Keane); the rates are then drawn
    given the levels. A current level may be `BEYOND` the end of its scale; a limit at that end has then
    failed.
    """
    random = stream(belief.seed, "forecast", belief.steps, "states")
    units = recombined(belief, drawn_rows(belief, 2 * count, random))
    units = replace(units, levels=units.levels + belief.shared)
    level, weights = _within_bounds(units.level, units.levels, random, belief.prior.least_friction)
    rate = _rates_given_levels(units, level, random)
    rows = systematic(weights, count, random)
    return UnitDraws(
        aged=units.aged[rows],
        exponents=units.exponents[rows],
        law=units.law[rows],
        life_scale=units.life_scale[rows],
        shape=units.shape[rows],
        roughness=units.roughness[rows],
        unevenness=units.unevenness[rows],
        level=within_bounds(level[rows], BEYOND, belief.prior.least_friction),
        rate=rate[rows],
    )


def paths(
    state: UnitDraws,
    prior: Prior,
    *,
    seed: int,
    pace: Array | float = 1.0,
    settings: ForecastSettings = FORECAST,
) -> Paths:
    """Return the paths of the levels, starting from `state`.

    Onsets, breaks and changes of law are modelled as in the filter; levels stay within their bounds.

    Parameters
    ----------
    pace
        Hours by which a component ages in an hour under the future stress, (n, 8) or one number.
    """
    random = stream(seed, "forecast", "paths")
    hours = _grid(settings)
    pace = np.broadcast_to(pace, state.law.shape)
    levels = np.empty((hours.size, *state.level.shape))
    noise = np.empty((hours.size - 1, *state.level.shape))
    levels[0] = state.level
    s = prior.settings
    for i, flown in enumerate(np.diff(hours)):
        state = _with_law_changes(state, flown, prior, random)
        step = _uneven(state, pace * flown, random)
        state = replace(state, rate=state.rate * breaks(state.law, state.life_scale, step, s, random))
        sets_in = onsets(state.law, state.life_scale, step, random)
        remaining_share = np.where(sets_in, in_common(random.random(state.law.shape)), 1.0)
        if sets_in.any():
            rows = np.flatnonzero(sets_in.any(axis=1))
            new = prior.after_onset((rows.size, state.law.shape[1]), random)
            shock = random.standard_normal(new.rate.shape)
            rate = with_rows(state.rate, rows, sets_in[rows], new.rate + new.rate_deviation * shock)
            state = replace(state, **replace_law_fields(state, rows, sets_in[rows], new), rate=rate)
        rate_gain, growth = transition(
            state.law,
            state.life_scale,
            state.shape,
            state.aged,
            remaining_share * step,
            s,
            prior.trajectories,
        )
        rate_gain = np.where(is_waiting(state.law), 0.0, rate_gain)
        of_level, of_rate = noise_rates(state.law, state.life_scale, state.roughness, s)
        noise[i] = np.sqrt(of_level * pace)
        shock = np.sqrt(of_rate * step) * random.standard_normal(state.law.shape)
        # The mean rate of the step contains half of the shock: integral of a Wiener process, to first order.
        level = state.level + rate_gain * state.rate + 0.5 * step * shock
        level += noise[i] * np.sqrt(flown) * random.standard_normal(state.law.shape)
        levels[i + 1] = level
        state = replace(
            state,
            aged=state.aged + step,
            level=within_bounds(level, least_friction=prior.least_friction),
            rate=np.clip(growth * state.rate + shock, -LARGEST_RATE, LARGEST_RATE),
        )
    return Paths(hours, levels, noise)


def _uneven(state: UnitDraws, hours: Array, random: np.random.Generator) -> Array:
    """Return the log-normal hours [h] of uneven ageing (n, 8) during `hours` (n, 8) of even ageing."""
    variance = np.log1p(state.unevenness**2 * state.life_scale / hours)
    shock = np.sqrt(variance) * in_common(random.standard_normal(hours.shape))
    return np.asarray(hours * np.exp(shock - variance / 2))


def _grid(settings: ForecastSettings) -> Array:
    """Return the times of the forecast [h], with steps that grow geometrically from the first step."""
    ratio = np.geomspace(1.0, settings.longest_hours / settings.first_step, settings.steps)
    return np.concatenate([[0.0], settings.first_step * ratio])


def _with_law_changes(state: UnitDraws, step: float, prior: Prior, random: np.random.Generator) -> UnitDraws:
    """Return `state` with the laws that change within `step` [h] drawn anew from the general prior."""
    changes = in_common(random.random(state.law.shape)) < -np.expm1(-step / prior.settings.change_hours)
    rows = np.flatnonzero(changes.any(axis=1))
    if not rows.size:
        return state
    changes, law = changes[rows], state.law[rows]
    drawn = prior.general(state.aged[rows], random)
    rate = drawn.rate + drawn.rate_deviation * random.standard_normal(law.shape)
    rate = with_rows(state.rate, rows, changes & ~keeps_rate(law, drawn.law), rate)
    return replace(state, **replace_law_fields(state, rows, changes, drawn), rate=rate)


def _within_bounds(
    mean: Array, covariance: Array, random: np.random.Generator, least_friction: float
) -> tuple[Array, Array]:
    """Return normal levels (n, 8) drawn within their bounds, and their importance weights (n,).

    The bounds are extended by `BEYOND`.
    """
    from scipy.special import ndtr, ndtri

    root, ends = _root(covariance), bounds(mean.shape[1], BEYOND, least_friction)
    drawn = np.zeros_like(mean)
    weights = np.ones(len(mean))
    for c in range(mean.shape[1]):
        centre = mean[:, c] + np.einsum("nj,nj->n", root[:, c, :c], drawn[:, :c])
        low, high = (ndtr((bound[c] - centre) / root[:, c, c]) for bound in ends)
        probability = np.maximum(high - low, 1e-12)
        weights *= probability
        drawn[:, c] = ndtri(np.clip(low + probability * random.random(len(mean)), 1e-12, 1 - 1e-12))
    level = mean + np.einsum("nij,nj->ni", root, drawn)
    return np.clip(level, *ends), weights


def _rates_given_levels(belief: Belief, level: Array, random: np.random.Generator) -> Array:
    """Return rates (n, 8) [1/h] of the particles, drawn given the levels (n, 8)."""
    gain = np.swapaxes(np.linalg.solve(belief.levels, belief.mixed), 1, 2)
    mean = belief.rate + np.einsum("nij,nj->ni", gain, level - belief.level)
    covariance = belief.rates - gain @ belief.mixed
    shocks = np.einsum("nij,nj->ni", _root(covariance), random.standard_normal(mean.shape))
    return np.where(is_moving(belief.law), np.clip(mean + shocks, -LARGEST_RATE, LARGEST_RATE), 0.0)


def _root(covariance: Array) -> Array:
    """Return lower triangular roots (n, 8, 8) of covariances, which may be singular.

    A covariance that rounding has made indefinite loses its correlations.
    """
    deviation = np.sqrt(np.maximum(np.einsum("nii->ni", covariance), 0.0))
    scale = np.where(deviation > 0, deviation, 1.0)
    correlation = covariance / scale[:, :, np.newaxis] / scale[:, np.newaxis, :]
    for regularisation in SINGULAR:
        try:
            return np.asarray(
                np.linalg.cholesky(correlation + regularisation * np.eye(covariance.shape[1]))
                * deviation[:, :, np.newaxis]
            )
        except np.linalg.LinAlgError:
            continue
    return np.asarray(deviation[:, :, np.newaxis] * np.eye(covariance.shape[1]))
