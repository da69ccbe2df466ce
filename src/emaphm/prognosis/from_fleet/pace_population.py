"""Population of the hours that components of a part number take from step to step towards a limit.

The margin of a component is divided into D = 10 steps (`Passages`). y is the vector of the logarithms of the
hours in which a component passes each step. A component belongs to one of two classes, in which y is normal
with the mean and covariance of the class, or it does not degrade:

    y ~ N(μ_k, Σ_k) with probability π_k, k = 1, 2;    no degradation with probability π_0
    μ_k ~ N(m, Σ_k / 0.5),    Σ_k ~ inverse Wishart around K,    π ~ Dirichlet(1, 1, ½)

m is the mean of all components of the fleet. K is a general prior: units differ in pace, the pace changes
slowly along the path, and each step scatters. No law of degradation is assumed: whether a component
accelerates, saturates, waits or changes its pace is learnt as mean and covariance.

Units that were removed before their limit have passed the first steps only. Their remaining steps are drawn,
given the units that have passed them (data augmentation [1]). A component that has not passed its first step
is waiting for its onset, or does not degrade. Given the passed steps of a unit, the logarithms of the hours
of its remaining steps are normal, weighted by the likelihood of each class and each draw of the population: a
growth model with random effects for each unit [2].

References
----------
[1] Tanner, Wong: The calculation of posterior distributions by data augmentation, Journal of the American
    Statistical Association 82 (1987); Diebolt, Robert: Estimation of finite mixture distributions through
    Bayesian sampling, Journal of the Royal Statistical Society B 56 (1994).
[2] Lu, Meeker: Using degradation measures to estimate a time-to-failure distribution, Technometrics 35
    (1993); Gebraeel, Lawley, Li, Ryan: Residual-life distributions from component degradation signals: a
    Bayesian approach, IIE Transactions 37 (2005).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr, ndtr, ndtri

from emaphm.arrays import Array
from emaphm.prognosis.from_fleet.passages import SHARES, Passages
from emaphm.prognosis.laws import Mask

CLASSES = 2
ABSENT = CLASSES + 1
"""Class number of a component that is not present; `CLASSES` is the number for no degradation."""

STEPS = SHARES.size


@dataclass(frozen=True)
class PacePopulationSettings:
    """The general prior K of the pace of components, and the sampling of the population.

    K has standard deviations, of the logarithm of a step's hours, of a unit's pace, `unit_deviation`; of its
    changes along the path, `change_deviation`, which persist over `correlation_steps` steps; and of each step
    alone, `step_deviation`. The first step has `first_step_deviation` in addition, as it contains the wait
    before the onset.

    K has the weight of `covariance_units` units, m that of `mean_units`. The consumed share of a component
    that does not degrade has the standard deviation `resting_deviation`, the error of a diagnosis.

    The first `burn_in` of the `sweeps` draws by Gibbs sampling are not used. Logarithms of the hours [h] of a
    step are limited to `longest_log_hours`, 137 years.

    No command measures the effect of these values alone; `python -m emaphm.study.fleet FOLDER` measures the
    forecasts. With `covariance_units` of 12, 5, 2 and 1, the CRPS of 240 forecasts late in life was 0.127,
    0.122, 0.119 and 0.119 of the RUL (docs/prognosis_development.md).
    """

    unit_deviation: float = 0.4
    change_deviation: float = 0.3
    step_deviation: float = 0.15
    correlation_steps: float = 3.0
    first_step_deviation: float = 0.3
    covariance_units: float = 3.0
    mean_units: float = 0.5
    resting_deviation: float = 0.02
    sweeps: int = 150
    burn_in: int = 50
    longest_log_hours: float = 14.0


PACE_POPULATION = PacePopulationSettings()


class PopulationDraws(NamedTuple):
    """S draws of the population of c components.

    `mean` (S, c, 2, D) and `precision` (S, c, 2, D, D) are those of the classes; `log_shares` (S, c, 3) are
    the log shares of units in the classes, and of units whose component does not degrade. `passed_counts` (c,
    D) is the number of the fleet's lives that have passed each step.
    """

    mean: Array
    precision: Array
    log_shares: Array
    passed_counts: Array


def general_covariance() -> Array:
    """Return the general covariance K, (D, D)."""
    s, i = PACE_POPULATION, np.arange(STEPS)
    correlation = np.exp(-np.abs(i[:, np.newaxis] - i) / s.correlation_steps)
    covariance = s.unit_deviation**2 + s.change_deviation**2 * correlation
    covariance[0, 0] += s.first_step_deviation**2
    return np.asarray(covariance + s.step_deviation**2 * np.eye(STEPS))


def sampled_population(
    fleet: Passages, random: np.random.Generator, present: Mask | None = None
) -> PopulationDraws:
    """Return draws of the population, by Gibbs sampling, given a `fleet` (c, n) of c components of n lives.

    The passages must contain at least one known step. The initial classes are those with falling and with
    rising hours along the path. If components have different numbers of lives, `present` (c, n) is True for
    those that exist; by default all.
    """
    general, m = general_covariance(), _general_mean(fleet)
    count, units = fleet.waited.shape
    mean = np.tile(m, (count, CLASSES, 1))
    precision = np.tile(np.linalg.inv(general), (count, CLASSES, 1, 1))
    log_shares = np.full((count, CLASSES + 1), -np.log(CLASSES + 1))
    of_class = _initial_classes(fleet, m)
    absent = np.zeros((count, units), bool) if present is None else ~present
    draws_after_burn_in = []
    rows, columns = np.arange(count)[:, np.newaxis], np.arange(units)
    for sweep in range(PACE_POPULATION.sweeps):
        weights, given = _class_weights(mean, precision, log_shares, fleet)
        if sweep:
            of_class = (weights + random.gumbel(size=weights.shape)).argmax(axis=1)
        of_class = np.where(absent, ABSENT, of_class)
        own_class = rows, np.minimum(of_class, CLASSES - 1), columns
        log_hours = _drawn_steps(_Conditional(*(part[own_class] for part in given)), fleet.waited, random)
        member = (of_class[:, np.newaxis] == np.arange(CLASSES)[:, np.newaxis]).astype(float)
        number = member.sum(axis=-1)
        at_rest = (of_class == CLASSES).sum(axis=1)
        gamma = random.gamma(np.column_stack([1 + number, 0.5 + at_rest]))
        log_shares = np.log(np.maximum(gamma / gamma.sum(axis=1, keepdims=True), 1e-6))
        mean, precision = _drawn_classes(log_hours, member, m, general, random)
        if sweep >= PACE_POPULATION.burn_in:
            draws_after_burn_in.append((mean, precision, log_shares))
    passed_counts = np.sum(fleet.passed[..., np.newaxis] > np.arange(STEPS), axis=1)
    means, precisions, shares = (np.stack(draws) for draws in zip(*draws_after_burn_in, strict=True))
    return PopulationDraws(means, precisions, shares, passed_counts)


def remaining_hours(
    population: PopulationDraws, component: int, passages: Passages, share: Array, random: np.random.Generator
) -> Array:
    """Return draws of the hours of ageing until the limit, (n,) [h]; `inf` if a component does not degrade.

    Parameters
    ----------
    population
        Draws of the population.
    component
        Index of the component in the population.
    passages
        Passages of this component of the unit.
    share
        Draws of the present consumed share of the margin, (n,), below 1 [-]: diagnoses have errors, so that
        `passages` alone does not determine it.
    random
        Source of the draws.
    """
    passed, count = int(passages.passed), share.size
    mean, precision, log_shares = (draws[:, component] for draws in population[:3])
    each = Passages(*(np.broadcast_to(part, (len(mean), 1, *part.shape)) for part in passages))
    weights, given = _class_weights(mean, precision, log_shares, each)
    weights = weights[..., 0]
    if passed == 0:
        # A wait has little information on the population, and draws differ most for long waits.
        weights = weights - np.logaddexp.reduce(weights, axis=1)[:, np.newaxis]
    weight = np.exp(weights - weights.max()).ravel()
    drawn = random.choice(weight.size, count, p=weight / weight.sum())
    draw, of_class = np.divmod(drawn, CLASSES + 1)
    own_class = draw, np.minimum(of_class, CLASSES - 1), 0
    of_chosen = _Conditional(*(part[own_class] for part in given))
    log_hours = _drawn_steps(of_chosen, np.full(count, passages.waited), random)
    hours = np.exp(np.minimum(log_hours, PACE_POPULATION.longest_log_hours))
    remaining = np.clip((SHARES - share[:, np.newaxis]) / np.diff(SHARES, prepend=0.0), 0.0, 1.0)
    if passed == 0:
        # Degradation may not have started: the time has more information on the first step than the share.
        hours[:, 0] -= np.exp(passages.waited)
        remaining[:, 0] = share < SHARES[0]
    return np.where(of_class == CLASSES, np.inf, np.sum(remaining * hours, axis=1))


class _Conditional(NamedTuple):
    """Distribution of y given the passages: mean (…, D), precision (…, D, D), covariance with y_1 (…, D)."""

    mean: Array
    precision: Array
    with_first: Array


def _general_mean(fleet: Passages) -> Array:
    """Return m, the mean of y over all components, (D,); that of the last known step for unknown steps."""
    known = fleet.precision > 0
    number = known.sum(axis=(0, 1))
    mean = np.sum(fleet.log_hours * known, axis=(0, 1)) / np.maximum(number, 1)
    last = int(np.flatnonzero(number)[-1])
    return np.asarray(np.where(number > 0, mean, mean[last]))


def _initial_classes(fleet: Passages, mean: Array) -> np.ndarray:
    """Return initial classes (c, n): 1 for a trend of y above the median, else 0; `CLASSES` without y."""
    known = fleet.precision > 0
    number = known.sum(axis=-1)
    deviations = np.where(known, fleet.log_hours - mean, 0.0)
    deviations = deviations - np.where(
        known, (deviations.sum(axis=-1) / np.maximum(number, 1))[..., np.newaxis], 0.0
    )
    trend = deviations @ (np.arange(STEPS) - (STEPS - 1) / 2)
    grows = trend > np.median(trend, axis=1, keepdims=True)
    return np.where(number == 0, CLASSES, grows.astype(int))


def _class_weights(
    mean: Array, precision: Array, log_shares: Array, known: Passages
) -> tuple[Array, _Conditional]:
    """Return log weights (c, 3, n) of the classes and of no degradation, and y given each class.

    The passages `known` (c, n) are those of c components of n units; `mean` (c, 2, D), `precision` and
    `log_shares` are one draw of the classes. The weight of a class is the density of the known steps. Before
    the first passage, it is the probability of a wait of this length; that of no degradation is then the
    density of the consumed share.
    """
    each = Passages(*(part[:, np.newaxis] for part in known))
    own = precision[:, :, np.newaxis]
    total = own + each.precision[..., np.newaxis] * np.eye(STEPS)
    prior = (precision @ mean[..., np.newaxis])[:, :, np.newaxis, :, 0]
    pull = prior + each.precision * each.log_hours
    first = np.broadcast_to(np.eye(STEPS)[0], pull.shape)
    solved = np.linalg.solve(total, np.stack([pull, first], axis=-1))
    given = _Conditional(solved[..., 0], total, solved[..., 1])
    # The density of the known steps, without factors that do not depend on the class.
    fit = np.sum(mean[:, :, np.newaxis] * prior, axis=-1) - np.sum(pull * given.mean, axis=-1)
    volume = np.linalg.slogdet(own)[1] - np.linalg.slogdet(total)[1]
    density = 0.5 * (volume - fit)
    deviation = np.sqrt(given.with_first[..., 0])
    waits = log_ndtr((given.mean[..., 0] - each.waited) / deviation) - np.log(SHARES[0])
    classes = np.where(each.passed > 0, density, waits) + log_shares[:, :-1, np.newaxis]
    resting = PACE_POPULATION.resting_deviation
    rests = -0.5 * (known.share / resting) ** 2 - np.log(resting * np.sqrt(2 * np.pi))
    rests = np.where(known.passed > 0, -np.inf, rests + log_shares[:, -1:])
    return np.concatenate([classes, rests[:, np.newaxis]], axis=1), given


def _drawn_steps(given: _Conditional, waited: Array, random: np.random.Generator) -> Array:
    """Return draws of y (…, D) given the passages, with a first step longer than `waited` (…)."""
    root = np.linalg.cholesky(given.precision)
    normal = random.standard_normal(given.mean.shape)
    free = given.mean + np.linalg.solve(np.swapaxes(root, -1, -2), normal[..., np.newaxis])[..., 0]
    deviation = np.sqrt(given.with_first[..., 0])
    below = ndtr((waited - given.mean[..., 0]) / deviation)
    uniform = np.clip(below + (1 - below) * random.random(below.shape), 1e-12, 1 - 1e-12)
    longer = np.maximum(given.mean[..., 0] + deviation * ndtri(uniform), waited)
    first = np.where(np.isfinite(waited), longer, free[..., 0])
    # The remaining steps, given the first: the free draw, shifted according to the covariance with the first.
    regression = given.with_first / given.with_first[..., :1]
    return np.asarray(free + regression * (first - free[..., 0])[..., np.newaxis])


def _drawn_classes(
    log_hours: Array, member: Array, m: Array, general: Array, random: np.random.Generator
) -> tuple[Array, Array]:
    """Return means (c, 2, D) and precisions (c, 2, D, D) of classes, drawn given their members.

    The draw is from the normal inverse Wishart posterior given y, `log_hours` (c, n, D), and `member` (c, 2,
    n) of 1 and 0, with Bartlett's decomposition for the Wishart part.
    """
    number = member.sum(axis=-1)
    average = member @ log_hours / np.maximum(number, 1)[..., np.newaxis]
    residual = (log_hours[:, np.newaxis] - average[:, :, np.newaxis]) * member[..., np.newaxis]
    weight = PACE_POPULATION.mean_units + number
    difference = average - m
    centre = (PACE_POPULATION.mean_units * m + number[..., np.newaxis] * average) / weight[..., np.newaxis]
    scatter = PACE_POPULATION.covariance_units * general + np.swapaxes(residual, -1, -2) @ residual
    outer = difference[..., np.newaxis] * difference[..., np.newaxis, :]
    scatter = scatter + (PACE_POPULATION.mean_units * number / weight)[..., np.newaxis, np.newaxis] * outer
    shape = scatter.shape
    factor = np.tril(random.standard_normal(shape), -1)
    freedom = (PACE_POPULATION.covariance_units + STEPS + 1 + number)[..., np.newaxis] - np.arange(STEPS)
    factor[..., np.arange(STEPS), np.arange(STEPS)] = np.sqrt(random.chisquare(freedom))
    root = np.linalg.cholesky(np.linalg.inv(scatter)) @ factor
    normal = random.standard_normal((*shape[:-1], 1))
    shift = np.linalg.solve(np.swapaxes(root, -1, -2), normal)[..., 0] / np.sqrt(weight)[..., np.newaxis]
    return centre + shift, root @ np.swapaxes(root, -1, -2)
