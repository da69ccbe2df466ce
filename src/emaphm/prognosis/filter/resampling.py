"""Particles drawn by their weights, each component on its own."""

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
"""Share of a rate's variance below which what the level leaves of it is a rounding error."""


def drawn_rows(belief: Belief, count: int, random: np.random.Generator) -> NDArray[np.intp]:
    """Return rows of the particles for each component, (count, 8), drawn by its weights, in any order."""
    columns = [random.permutation(systematic(one, count, random)) for one in belief.weights.T]
    return in_common(np.stack(columns, axis=1))


def recombined(belief: Belief, rows: NDArray[np.intp]) -> Belief:
    """Return the belief with component c of particle i taken from particle `rows`[i, c], equally weighted.

    A component brings the means and the covariance of its level and rate. How components are correlated is
    that of all particles, by their weights: covariances are averaged between x/σ_x and the part of v that x
    does not say, (v - k x)/σ_v|x, k = cov(v, x)/σ_x², so that the new ones are positive definite too.
    """
    a, k, s = _own(belief)
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


def _own(belief: Belief) -> tuple[Array, Array, Array]:
    """Return σ_x, k and σ_v|x of each particle's components, (n, 8) each, as in `recombined`."""
    variance = np.maximum(np.einsum("nii->ni", belief.levels), LEAST_VARIANCE)
    k = np.einsum("nii->ni", belief.mixed) / variance
    of_rate = np.einsum("nii->ni", belief.rates)
    rest = of_rate - k**2 * variance
    return np.sqrt(variance), k, np.sqrt(np.where(rest > ROUNDING * of_rate, rest, 0.0))


def _mean_product(weights: Array, values: Array, left: Array, right: Array) -> Array:
    """Return the weighted mean of diag(left) values diag(right), (8, 8)."""
    weighted = weights[:, np.newaxis] * left
    return np.asarray(np.einsum("nij,ni,nj->ij", values, weighted, right))


class Kinds(NamedTuple):
    """Kinds of particles, of one component: the number of each particle's (n,), and how many are of each."""

    number: NDArray[np.intp]
    size: NDArray[np.intp]


def kinds_of(groups: Array, components: Mask) -> tuple[Kinds | None, ...]:
    """Return the kinds of particles that `groups` (n, c) number, None but for the `components` (c,)."""
    kinds: list[Kinds | None] = [None] * groups.shape[1]
    for c in np.flatnonzero(components):
        _, number, count = np.unique(groups[:, c], return_inverse=True, return_counts=True)
        kinds[c] = Kinds(number, count)
    return tuple(kinds)


def apart_again(
    values: Array, kinds: Sequence[Kinds | None], settings: FilterSettings, random: np.random.Generator
) -> Array:
    """Return positive `values` (n, c) of resampled particles, copies of which differ again.

    By a kernel that widens nothing: among particles of one of the `kinds` of each component, the logarithm is
    drawn towards the mean by as much as its scatter adds [2]:

        y⁺ = a y + (1 - a) mean(y) + √(1 - a²) max(sd(y), least) z

    a being `shrinkage`, least `least_spread`, z standard normal. Components without kinds stay as they are.

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
    """Return `count` indices of `weights` (n,), each as often as its weight asks, to one more or less."""
    places = (np.arange(count) + random.random()) / count * np.sum(weights)
    return np.minimum(np.searchsorted(np.cumsum(weights), places), len(weights) - 1)
