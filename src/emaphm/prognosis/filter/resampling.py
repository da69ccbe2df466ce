"""Resampling of particles according to their weights, separately for each component."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.prognosis.belief import LEAST_VARIANCE, Belief
from emaphm.prognosis.laws import Mask, in_common
from emaphm.prognosis.settings import FilterSettings

ROUNDING = 1e-9
"""Conditional variance of a rate given the level, relative to its variance, below which it is rounding
error."""


def drawn_rows(belief: Belief, count: int, random: np.random.Generator) -> NDArray[np.intp]:
    """Return rows (count, 8) of the particles, drawn for each component by its weights, in random order."""
    columns = [random.permutation(systematic(weights, count, random)) for weights in belief.weights.T]
    return in_common(np.stack(columns, axis=1))


def recombined(belief: Belief, rows: NDArray[np.intp]) -> Belief:
    """Return the filter state with component c of particle i taken from particle `rows`[i, c], equal weights.

    A component keeps the means and the covariance of its level and rate. The correlations between components
    are the weighted means over all particles, computed for x/σ_x and for the part of v that is independent of
    x, (v - k x)/σ_v|x with k = cov(v, x)/σ_x², so that the new covariances are positive definite too.
    """
    a, k, s = _level_and_rate_deviations(belief)
    inverse_a, inverse_s = 1 / a, np.divide(1.0, s, out=np.zeros_like(s), where=s > 0)
    w = belief.weights.mean(axis=1)
    given_level = belief.mixed - belief.levels * k[:, np.newaxis, :]
    of_v = belief.rates - k[:, :, np.newaxis] * given_level
    of_v -= np.swapaxes(belief.mixed, 1, 2) * k[:, np.newaxis, :]
    levels = _mean_product(w, belief.levels, inverse_a, inverse_a)
    mixed = _mean_product(w, given_level, inverse_a, inverse_s)
    rates = _mean_product(w, of_v, inverse_s, inverse_s)
    np.fill_diagonal(levels, 1.0)
    np.fill_diagonal(mixed, 0.0)
    np.fill_diagonal(rates, 1.0)
    columns = np.arange(belief.law.shape[1])
    a, k, s = a[rows, columns], k[rows, columns], s[rows, columns]
    new_levels = levels * a[:, :, np.newaxis] * a[:, np.newaxis, :]
    given_level = mixed * a[:, :, np.newaxis] * s[:, np.newaxis, :]
    new_mixed = given_level + new_levels * k[:, np.newaxis, :]
    new_rates = rates * s[:, :, np.newaxis] * s[:, np.newaxis, :] + k[:, :, np.newaxis] * new_mixed
    new_rates += np.swapaxes(given_level, 1, 2) * k[:, np.newaxis, :]
    return replace(
        belief,
        aged=belief.aged[rows, columns],
        law=belief.law[rows, columns],
        life_scale=belief.life_scale[rows, columns],
        shape=belief.shape[rows, columns],
        roughness=belief.roughness[rows, columns],
        unevenness=belief.unevenness[rows, columns],
        age_and_level=belief.age_and_level[rows, columns],
        exponents=belief.exponents[rows, columns],
        level=belief.level[rows, columns],
        rate=belief.rate[rows, columns],
        levels=new_levels,
        mixed=new_mixed,
        rates=new_rates,
        log_weights=np.full(rows.shape, -np.log(len(rows))),
    )


def _level_and_rate_deviations(belief: Belief) -> tuple[Array, Array, Array]:
    """Return σ_x, k and σ_v|x (n, 8) of each particle's components, as in `recombined`."""
    variance = np.maximum(np.einsum("nii->ni", belief.levels), LEAST_VARIANCE)
    k = np.einsum("nii->ni", belief.mixed) / variance
    of_rate = np.einsum("nii->ni", belief.rates)
    conditional = of_rate - k**2 * variance
    return np.sqrt(variance), k, np.sqrt(np.where(conditional > ROUNDING * of_rate, conditional, 0.0))


def _mean_product(weights: Array, values: Array, left: Array, right: Array) -> Array:
    """Return the weighted mean of diag(left) values diag(right), (8, 8)."""
    weighted = weights[:, np.newaxis] * left
    return np.asarray(np.einsum("nij,ni,nj->ij", values, weighted, right))


class Kinds(NamedTuple):
    """Groups of particles for one component: group number of each particle (n,), and sizes of the groups."""

    number: NDArray[np.intp]
    size: NDArray[np.intp]


def kinds_of(groups: Array, components: Mask) -> tuple[Kinds | None, ...]:
    """Return the particles' groups of equal values in `groups` (n, c); None outside `components` (c,)."""
    kinds: list[Kinds | None] = [None] * groups.shape[1]
    for c in np.flatnonzero(components):
        _, number, count = np.unique(groups[:, c], return_inverse=True, return_counts=True)
        kinds[c] = Kinds(number, count)
    return tuple(kinds)


def apart_again(
    values: Array, kinds: Sequence[Kinds | None], settings: FilterSettings, random: np.random.Generator
) -> Array:
    """Return positive `values` (n, c) of resampled particles, with copies jittered by a kernel.

    The kernel preserves the variance within each of the `kinds` of a component: the logarithm is shrunk
    towards the mean to compensate the added scatter [2]:

        y⁺ = a y + (1 - a) mean(y) + √(1 - a²) max(sd(y), least) z

    where a is `shrinkage`, least is `least_spread`, and z is standard normal. Components without kinds are
    not changed.

    References
    ----------
    [2] Liu, West: Combined parameter and state estimation in simulation-based filtering, in: Sequential
        Monte Carlo Methods in Practice (2001).
    """
    a, result = settings.shrinkage, values.copy()
    for c, kind in enumerate(kinds):
        z = random.standard_normal(len(values))
        if kind is None:
            continue
        y = np.log(np.maximum(values[:, c], np.finfo(float).tiny))
        mean = np.bincount(kind.number, y) / kind.size
        deviation = y - mean[kind.number]
        spread = np.sqrt(np.maximum(np.bincount(kind.number, deviation**2) / kind.size, 0.0))
        noise = np.sqrt(1 - a**2) * np.maximum(spread, settings.least_spread)[kind.number]
        result[:, c] = np.exp(a * y + (1 - a) * mean[kind.number] + noise * z)
    return result


def systematic(weights: Array, count: int, random: np.random.Generator) -> NDArray[np.intp]:
    """Return `count` indices drawn by systematic resampling according to `weights` (n,)."""
    places = (np.arange(count) + random.random()) / count * np.sum(weights)
    return np.minimum(np.searchsorted(np.cumsum(weights), places), len(weights) - 1)
