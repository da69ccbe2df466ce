"""How sure an estimate that was found is, and what of it is known only together."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from emaphm.identification.correction import PRIOR_DEVIATION
from emaphm.identification.fit import CORRELATED_ROWS, Fit
from emaphm.identification.groups import Group, confounded, remedies
from emaphm.identification.nuisance import BASELINE, KNOWN_BY
from emaphm.identification.refinement import scattered
from emaphm.identification.search import Found
from emaphm.identification.uncertainty import Knowledge, assured, knowledge
from emaphm.identification.verdict import HEALTHY_MARGIN, Z95
from emaphm.simulation import OBSERVABLE

Array = NDArray[np.float64]

RESOLUTION = 2e-4
"""Standard error that no data go below: kinks of stick-slip leave the least squares that much play."""

FURTHER_SHARE = 0.03
"""Residual, as a share of its rms, that is expected of a channel which was not recorded."""

DERIVATIVE_STEP, DERIVATIVES = 1e-2, 8
"""Step of the differences that uncertainty is told from, and how often they are taken."""


@dataclass(frozen=True, eq=False)
class Confidence:
    """The `covariance` (d, d) of an estimate, its `groups`, and the `evaluations` that it took to tell."""

    covariance: Array
    groups: tuple[Group, ...]
    evaluations: int


def confidence(found: Found, residual: Array, names: tuple[str, ...], seed: int) -> Confidence:
    """Return how sure `found` is, whose `residual` (rows,) is left and whose coordinates have `names`.

    Where the reference model was not asked whether it knows better points, a Gauss-Newton step is left to
    do: towards the optimum that a swarm may not have reached, and for the model's discrepancy not yet
    corrected. The covariance then allows for it.
    """
    fit, space = found.fit, found.fit.space
    rows, faults = fit.recorded_rows, len(space.columns)
    known, derivatives, spent = known_at(fit, found.point, residual[:rows], seed)
    covariance = known.covariance
    groups, more = _groups(found, covariance, names, seed)
    if found.settled:
        return Confidence(covariance, groups, spent + more)
    bias = 0.0 if found.discrepancy is None else found.discrepancy - found.correction
    variance = float(np.mean(residual[:rows] ** 2))
    gradient = derivatives.mean(axis=0) @ (residual - bias)[:rows] / variance
    prior = CORRELATED_ROWS / _deviations(fit) ** 2
    gradient[faults:] -= prior[faults:] * found.point[faults:]
    step = np.linalg.solve(known.information + np.diag(prior), gradient)
    left = space.project(found.point + step) - found.point
    return Confidence(covariance + np.outer(left, left), groups, spent + more)


def known_at(fit: Fit, point: Array, residual: Array, seed: int) -> tuple[Knowledge, Array, int]:
    """Return what a `residual` (recorded rows,) leaves to know of `point` (d,).

    And the derivatives (n, d, recorded rows) that this is told from, and the simulations spent.
    """
    space, rows = fit.space, fit.recorded_rows
    derivatives, spent = scattered(
        lambda points: fit.outputs(points)[:, :rows], point, space, DERIVATIVE_STEP, DERIVATIVES, seed
    )
    known = knowledge(derivatives, residual, _deviations(fit), len(fit.problem.channels))
    covariance = known.covariance + RESOLUTION**2 * np.eye(space.dimensions)
    return replace(known, covariance=covariance), derivatives, spent


def _deviations(fit: Fit) -> Array:
    """Return the standard deviation of each coordinate before the data, (d,)."""
    faults = np.full(len(fit.space.columns), PRIOR_DEVIATION)
    return np.concatenate([faults, fit.space.nuisances.priors])


def _groups(
    found: Found, covariance: Array, names: tuple[str, ...], seed: int
) -> tuple[tuple[Group, ...], int]:
    """Return the groups of which only the sum is known, and the simulations spent.

    Groups of nuisances alone are left out, and components that are known well enough for all that.
    """
    faults = len(found.fit.space.columns)
    errors = np.sqrt(np.diag(covariance))
    chosen: dict[tuple[str, ...], list[int]] = {}
    for members in confounded(covariance):
        matter = [i for i in members if i >= faults or Z95 * errors[i] > HEALTHY_MARGIN]
        called = tuple(dict.fromkeys(_called(names[i]) for i in matter))
        if len(called) > 1 and matter[0] < faults:
            chosen[called] = matter
    if not chosen:
        return (), 0
    more, spent = _further_information(found, names, seed)
    channels = found.fit.problem.channels
    return tuple(
        Group(called, channels, remedies(covariance, members, more)) for called, members in chosen.items()
    ), spent


def _called(name: str) -> str:
    """Return what a coordinate belongs to: the eccentricity has two of them, the baseline several."""
    return "the baseline" if name.startswith(BASELINE) else name.removesuffix("_x").removesuffix("_y")


def _further_information(found: Found, names: tuple[str, ...], seed: int) -> tuple[dict[str, Array], int]:
    """Return the information (d, d) that each channel not recorded would add, and the simulations spent."""
    fit, space = found.fit, found.fit.space
    missing = tuple(name for name in OBSERVABLE if name not in fit.problem.channels)
    if fit.problem.actuator.electrical is None:
        missing = tuple(name for name in missing if name != "voltage_V")
    more = {}
    for i, name in enumerate(names):
        if name in KNOWN_BY:
            exactly = np.zeros_like(found.point)
            exactly[i] = 1 / RESOLUTION
            more[KNOWN_BY[name]] = np.outer(exactly, exactly)
    if not missing:
        return more, 0
    unweighted = replace(fit.problem, channels=missing, weights=np.ones(len(missing)))
    other = replace(fit, problem=unweighted)
    rows = other.recorded_rows
    derivatives, spent = scattered(
        lambda points: other.outputs(points)[:, :rows],
        found.point,
        space,
        DERIVATIVE_STEP,
        DERIVATIVES,
        seed,
    )
    levels = other.outputs(found.point[np.newaxis])[0, :rows]
    parts = zip(np.split(levels, len(missing)), np.split(derivatives, len(missing), axis=2), strict=True)
    for name, (level, part) in zip(missing, parts, strict=True):
        error = FURTHER_SHARE * np.sqrt(np.mean(level**2))
        more[name] = assured(part) / (error**2 * CORRELATED_ROWS)
    return more, spent + 1
