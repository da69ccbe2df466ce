"""How sure an estimate that was found is, and what of it is known only together."""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.verdict import HEALTHY_MARGIN, Z95
from emaphm.estimation.bias_correction import RESOLUTION
from emaphm.estimation.collinearity import Group, confounded, remedies
from emaphm.estimation.covariance import assured
from emaphm.estimation.local_covariance import neighbourhood, slopes
from emaphm.estimation.nuisances import BASELINE, KNOWN_BY
from emaphm.estimation.objective import CORRELATED_ROWS
from emaphm.estimation.parameter_space import PRIOR_DEVIATION
from emaphm.estimation.problem import comparable
from emaphm.estimation.search import Found

FURTHER_SHARE = 0.03
"""Residual, as a share of its rms, that is expected of a channel which was not recorded."""


@dataclass(frozen=True, eq=False)
class Confidence:
    """The `covariance` (d, d) of an estimate, its `groups`, and the `evaluations` that it took to tell."""

    covariance: Array
    groups: tuple[Group, ...]
    evaluations: int


def confidence(found: Found, residual: Array, seed: int) -> Confidence:
    """Return how sure `found` is, whose `residual` (rows,) is left.

    Where the reference model was not asked whether it knows better points, a Gauss-Newton step is left to
    do: towards the optimum that a swarm may not have reached, and for the model's discrepancy not yet
    corrected. The covariance then allows for it.
    """
    fit, space = found.fit, found.fit.space
    rows = fit.recorded_rows
    bias = 0.0 if found.discrepancy is None else (found.discrepancy - found.correction)[:rows]
    derivatives, spent = slopes(fit, found.point, seed)
    near = neighbourhood(fit, found.point, residual[:rows], derivatives, bias)
    covariance = near.covariance + found.play
    groups, more = _groups(found, covariance, seed)
    evaluations = spent + more
    if found.settled:
        return Confidence(covariance, groups, evaluations)
    left = space.project(found.point + near.step) - found.point
    return Confidence(covariance + np.outer(left, left), groups, evaluations)


def _groups(found: Found, covariance: Array, seed: int) -> tuple[tuple[Group, ...], int]:
    """Return the groups of which only the sum is known, and the simulations spent.

    Groups of nuisances alone are left out, and components that are known well enough for all that.
    """
    faults, names = len(found.fit.space.columns), found.fit.space.coordinates
    errors = np.sqrt(np.diag(covariance))
    chosen: dict[tuple[str, ...], list[int]] = {}
    for members in confounded(covariance):
        matter = [i for i in members if i >= faults or Z95 * errors[i] > HEALTHY_MARGIN]
        called = tuple(dict.fromkeys(_called(names[i]) for i in matter))
        if len(called) > 1 and matter[0] < faults:
            chosen[called] = matter
    if not chosen:
        return (), 0
    more, spent = _further_information(found, seed)
    channels = found.fit.problem.channels
    return tuple(
        Group(called, channels, remedies(covariance, members, more)) for called, members in chosen.items()
    ), spent


def _called(name: str) -> str:
    """Return what a coordinate belongs to: the eccentricity has two of them, the baseline several."""
    return "the baseline" if name.startswith(BASELINE) else name.removesuffix("_x").removesuffix("_y")


def _further_information(found: Found, seed: int) -> tuple[dict[str, Array], int]:
    """Return the information (d, d) that each channel not recorded would add, and the simulations spent."""
    fit = found.fit
    possible = comparable(fit.problem.actuator)
    missing = tuple(name for name in possible if name not in fit.problem.channels)
    more = {}
    for i, name in enumerate(fit.space.coordinates):
        if name in KNOWN_BY:
            exactly = np.zeros_like(found.point)
            exactly[i] = 1 / RESOLUTION
            more[KNOWN_BY[name]] = np.outer(exactly, exactly)
    if not missing:
        return more, 0
    unweighted = replace(fit.problem, channels=missing, weights=np.ones(len(missing)))
    other = replace(fit, problem=unweighted)
    derivatives, spent = slopes(other, found.point, seed)
    levels = other.outputs(found.point[np.newaxis])[0, : other.recorded_rows]
    parts = zip(np.split(levels, len(missing)), np.split(derivatives, len(missing), axis=2), strict=True)
    for name, (level, part) in zip(missing, parts, strict=True):
        # Where next to nothing moves, a channel's size is that of what the faults would make of it.
        size = max(float(np.sqrt(np.mean(level**2))), PRIOR_DEVIATION * float(np.sqrt(np.mean(part**2))))
        if size > 0:
            more[name] = assured(part) / ((FURTHER_SHARE * size) ** 2 * CORRELATED_ROWS)
    return more, spent + 1
