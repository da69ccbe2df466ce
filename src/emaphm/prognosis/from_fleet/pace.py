"""How components of a part number pace their way to a limit: a population learnt from the units of a fleet.

A component's slowness y (`Passages`), the logarithms of the hours that each step of the way takes, is normal
in each of two classes of units, with mean and covariance of the class; or the component does not degrade:

    y ~ N(μ_k, Σ_k) with probability π_k, k = 1, 2;    none with probability π_0
    μ_k ~ N(m, Σ_k / 0.5),    Σ_k ~ inverse Wishart around K,    π ~ Dirichlet(1, 1, ½)

m is the mean of all components of the fleet, K a general belief: units differ in pace, the pace changes
slowly along the way, and each step scatters. No law of degradation is assumed: that a component accelerates,
saturates, waits or changes its pace on the way is learnt as mean and covariance. Units that were removed
before their limit have shown the first steps, and the rest follows from those who have gone them (data
augmentation [1]); a component that waits at its start is there for that long, or does not degrade. Given what
a unit has gone, the hours of the rest are normal in logarithms, weighted by how well each class and draw of
the population agrees with it: a growth model with random effects for each unit [2].

References
----------
[1] Tanner, Wong: The calculation of posterior distributions by data augmentation, Journal of the American
    Statistical Association 82 (1987); Diebolt, Robert: Estimation of finite mixture distributions through
    Bayesian sampling, Journal of the Royal Statistical Society B 56 (1994).
[2] Lu, Meeker: Using degradation measures to estimate a time-to-failure distribution, Technometrics 35
    (1993); Gebraeel, Lawley, Li, Ryan: Residual-life distributions from component degradation signals: a
    Bayesian approach, IIE Transactions 37 (2005).
"""

from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr, ndtr, ndtri

from emaphm.arrays import Array
from emaphm.prognosis.from_fleet.passages import SHARES, Passages
from emaphm.prognosis.laws import Mask

CLASSES = 2
OF_NONE = CLASSES + 1
"""In place of a class, of what is not there; `CLASSES` is that of components that do not degrade."""

STEPS = SHARES.size

OF_PACE, OF_CHANGE, OF_STEP = 0.4, 0.3, 0.15
"""Standard deviations of K: of a unit's pace, of its changes along the way, of each step alone [-]."""

ALIKE = 3.0
"""Steps over which a change of pace persists."""

OF_START = 0.3
"""Standard deviation that the first step has in addition: it holds the wait before the onset."""

COUNTS = 12.0
"""Units that K counts as."""

MEAN_COUNTS = 0.5
"""Units that m counts as."""

AT_REST = 0.02
"""Standard deviation of the share of the way of a component that does not degrade."""

SWEEPS, FIRST_KEPT = 150, 50
"""Draws of the population, and from which on they are kept."""

LONGEST = 14.0
"""Logarithm of hours [h] of a step that is not distinguished from longer ones: 137 years."""


class PopulationDraws(NamedTuple):
    """S draws of what a fleet teaches of c components.

    `mean` (S, c, 2, D) and `precision` (S, c, 2, D, D) of the classes; `log_shares` (S, c, 3) of the units in
    the classes, and of those whose component does not degrade. `gone` (c, D) is how many of the fleet have
    gone each step.
    """

    mean: Array
    precision: Array
    log_shares: Array
    gone: Array


def general_covariance() -> Array:
    """Return K, (D, D)."""
    i = np.arange(STEPS)
    covariance = OF_PACE**2 + OF_CHANGE**2 * np.exp(-np.abs(i[:, np.newaxis] - i) / ALIKE)
    covariance[0, 0] += OF_START**2
    return np.asarray(covariance + OF_STEP**2 * np.eye(STEPS))


def learnt(fleet: Passages, random: np.random.Generator, there: Mask | None = None) -> PopulationDraws:
    """Return draws of the population, by Gibbs sampling, given a `fleet` (c, n) of c components of n units.

    Some step of some component must have been seen. Classes begin as those whose pace falls and rises most.
    Where components are not all of as many units, `there` (c, n) says which are; all where left out.
    """
    general, m = general_covariance(), _general_mean(fleet)
    count, units = fleet.waited.shape
    mean = np.tile(m, (count, CLASSES, 1))
    precision = np.tile(np.linalg.inv(general), (count, CLASSES, 1, 1))
    log_shares = np.full((count, CLASSES + 1), -np.log(CLASSES + 1))
    of_class = _by_trend(fleet, m)
    absent = np.zeros((count, units), bool) if there is None else ~there
    kept = []
    rows, columns = np.arange(count)[:, np.newaxis], np.arange(units)
    for sweep in range(SWEEPS):
        weights, given = _agreement(mean, precision, log_shares, fleet)
        if sweep:
            of_class = (weights + random.gumbel(size=weights.shape)).argmax(axis=1)
        of_class = np.where(absent, OF_NONE, of_class)
        chosen = rows, np.minimum(of_class, CLASSES - 1), columns
        slowness = _drawn(_Given(*(part[chosen] for part in given)), fleet.waited, random)
        member = (of_class[:, np.newaxis] == np.arange(CLASSES)[:, np.newaxis]).astype(float)
        number = member.sum(axis=-1)
        at_rest = (of_class == CLASSES).sum(axis=1)
        gamma = random.gamma(np.column_stack([1 + number, 0.5 + at_rest]))
        log_shares = np.log(np.maximum(gamma / gamma.sum(axis=1, keepdims=True), 1e-6))
        mean, precision = _classes(slowness, member, m, general, random)
        if sweep >= FIRST_KEPT:
            kept.append((mean, precision, log_shares))
    gone = np.sum(fleet.passed[..., np.newaxis] > np.arange(STEPS), axis=1)
    means, precisions, shares = (np.stack(draws) for draws in zip(*kept, strict=True))
    return PopulationDraws(means, precisions, shares, gone)


def hours_left(
    population: PopulationDraws, component: int, one: Passages, share: Array, random: np.random.Generator
) -> Array:
    """Return hours of ageing until a component is at its limit, (n,) [h]; `inf` if it does not degrade.

    `component` is its place in the population; `one` what is known of its pace; `share` (n,) below 1, of its
    way, are as many draws of where it is now. Diagnoses err, so that `one` alone does not say that.
    """
    passed, count = int(one.passed), share.size
    mean, precision, log_shares = (draws[:, component] for draws in population[:3])
    each = Passages(*(np.broadcast_to(part, (len(mean), 1, *part.shape)) for part in one))
    weights, given = _agreement(mean, precision, log_shares, each)
    weights = weights[..., 0]
    if passed == 0:
        # What a wait says of the population as a whole is little, and its draws differ most where it is long.
        weights = weights - np.logaddexp.reduce(weights, axis=1)[:, np.newaxis]
    weight = np.exp(weights - weights.max()).ravel()
    drawn = random.choice(weight.size, count, p=weight / weight.sum())
    draw, of_class = np.divmod(drawn, CLASSES + 1)
    chosen = draw, np.minimum(of_class, CLASSES - 1), 0
    slowness = _drawn(_Given(*(part[chosen] for part in given)), np.full(count, one.waited), random)
    hours = np.exp(np.minimum(slowness, LONGEST))
    left = np.clip((SHARES - share[:, np.newaxis]) / np.diff(SHARES, prepend=0.0), 0.0, 1.0)
    if passed == 0:
        # Of a step that may not have begun, the time says more than the share.
        hours[:, 0] -= np.exp(one.waited)
        left[:, 0] = share < SHARES[0]
    return np.where(of_class == CLASSES, np.inf, np.sum(left * hours, axis=1))


class _Given(NamedTuple):
    """Slowness given what is known of it: mean (…, D), precision (…, D, D), covariance with y_1 (…, D)."""

    mean: Array
    precision: Array
    with_first: Array


def _general_mean(fleet: Passages) -> Array:
    """Return the mean slowness over all components, (D,); the last known of steps that none has gone."""
    known = fleet.precision > 0
    number = known.sum(axis=(0, 1))
    mean = np.sum(fleet.slowness * known, axis=(0, 1)) / np.maximum(number, 1)
    last = int(np.flatnonzero(number)[-1])
    return np.asarray(np.where(number > 0, mean, mean[last]))


def _by_trend(fleet: Passages, mean: Array) -> np.ndarray:
    """Return first classes (c, n): by whether the slowness grows along the way by more than the median."""
    known = fleet.precision > 0
    number = known.sum(axis=-1)
    apart = np.where(known, fleet.slowness - mean, 0.0)
    apart = apart - np.where(known, (apart.sum(axis=-1) / np.maximum(number, 1))[..., np.newaxis], 0.0)
    trend = apart @ (np.arange(STEPS) - (STEPS - 1) / 2)
    grows = trend > np.median(trend, axis=1, keepdims=True)
    return np.where(number == 0, CLASSES, grows.astype(int))


def _agreement(mean: Array, precision: Array, log_shares: Array, known: Passages) -> tuple[Array, _Given]:
    """Return log weights (c, 3, n) of the classes and of no degradation, and the slowness given each class.

    For c components of n units, `known` (c, n), and c draws of classes: `mean` (c, 2, D) and so on. A class
    weighs by the density of what was measured; before the first passage, by the probability of having waited
    for so long, against that of the share at which a component rests.
    """
    each = Passages(*(part[:, np.newaxis] for part in known))
    own = precision[:, :, np.newaxis]
    total = own + each.precision[..., np.newaxis] * np.eye(STEPS)
    prior = (precision @ mean[..., np.newaxis])[:, :, np.newaxis, :, 0]
    pull = prior + each.precision * each.slowness
    first = np.broadcast_to(np.eye(STEPS)[0], pull.shape)
    solved = np.linalg.solve(total, np.stack([pull, first], axis=-1))
    given = _Given(solved[..., 0], total, solved[..., 1])
    # The density of what is known but for factors that do not depend on the class.
    fit = np.sum(mean[:, :, np.newaxis] * prior, axis=-1) - np.sum(pull * given.mean, axis=-1)
    volume = np.linalg.slogdet(own)[1] - np.linalg.slogdet(total)[1]
    density = 0.5 * (volume - fit)
    deviation = np.sqrt(given.with_first[..., 0])
    waits = log_ndtr((given.mean[..., 0] - each.waited) / deviation) - np.log(SHARES[0])
    classes = np.where(each.passed > 0, density, waits) + log_shares[:, :-1, np.newaxis]
    rests = -0.5 * (known.share / AT_REST) ** 2 - np.log(AT_REST * np.sqrt(2 * np.pi))
    rests = np.where(known.passed > 0, -np.inf, rests + log_shares[:, -1:])
    return np.concatenate([classes, rests[:, np.newaxis]], axis=1), given


def _drawn(given: _Given, waited: Array, random: np.random.Generator) -> Array:
    """Return slowness (…, D) drawn given what is known, the first step longer than was `waited` (…)."""
    root = np.linalg.cholesky(given.precision)
    normal = random.standard_normal(given.mean.shape)
    free = given.mean + np.linalg.solve(np.swapaxes(root, -1, -2), normal[..., np.newaxis])[..., 0]
    deviation = np.sqrt(given.with_first[..., 0])
    below = ndtr((waited - given.mean[..., 0]) / deviation)
    uniform = np.clip(below + (1 - below) * random.random(below.shape), 1e-12, 1 - 1e-12)
    longer = np.maximum(given.mean[..., 0] + deviation * ndtri(uniform), waited)
    first = np.where(np.isfinite(waited), longer, free[..., 0])
    # The others, given the first: what is drawn freely, moved along.
    along = given.with_first / given.with_first[..., :1]
    return np.asarray(free + along * (first - free[..., 0])[..., np.newaxis])


def _classes(
    slowness: Array, member: Array, m: Array, general: Array, random: np.random.Generator
) -> tuple[Array, Array]:
    """Return means (c, 2, D) and precisions (c, 2, D, D) of classes, drawn given their members.

    Of slowness (c, n, D), `member` (c, 2, n) of 1 and 0: the normal inverse Wishart posterior, its Wishart
    part by Bartlett's decomposition.
    """
    number = member.sum(axis=-1)
    average = member @ slowness / np.maximum(number, 1)[..., np.newaxis]
    rest = (slowness[:, np.newaxis] - average[:, :, np.newaxis]) * member[..., np.newaxis]
    weight = MEAN_COUNTS + number
    apart = average - m
    centre = (MEAN_COUNTS * m + number[..., np.newaxis] * average) / weight[..., np.newaxis]
    scatter = COUNTS * general + np.swapaxes(rest, -1, -2) @ rest
    outer = apart[..., np.newaxis] * apart[..., np.newaxis, :]
    scatter = scatter + (MEAN_COUNTS * number / weight)[..., np.newaxis, np.newaxis] * outer
    shape = scatter.shape
    factor = np.tril(random.standard_normal(shape), -1)
    freedom = (COUNTS + STEPS + 1 + number)[..., np.newaxis] - np.arange(STEPS)
    factor[..., np.arange(STEPS), np.arange(STEPS)] = np.sqrt(random.chisquare(freedom))
    root = np.linalg.cholesky(np.linalg.inv(scatter)) @ factor
    normal = random.standard_normal((*shape[:-1], 1))
    shift = np.linalg.solve(np.swapaxes(root, -1, -2), normal)[..., 0] / np.sqrt(weight)[..., np.newaxis]
    return centre + shift, root @ np.swapaxes(root, -1, -2)
