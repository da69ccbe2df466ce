"""Profile likelihood of a nuisance by the reference model, at two values about nominal.

With a wrong inertia, the search by the averaged model ends at faults that compensate for it. Its descents
stop at local minima at the kinks of stick-slip, and the residuals at the right and at the wrong inertia
differ by one or two percent only. The reference model separates the two, because the effects that the
averaged model lacks also depend on the parameters. It is run at two points of the profile likelihood (Cox and
Hinkley 1974, ch. 9): the nuisance below and above nominal, the other parameters refitted.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import compared
from emaphm.estimation.discrepancy import REFERENCE_RUNS, reference_problem
from emaphm.estimation.global_search.multistart import descents_from
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.fisher_information import information
from emaphm.random_streams import stream

INERTIA = "inertia"

PROFILED = (INERTIA,)
"""Nuisances that are tested by the reference model: faults compensate for them in the averaged model."""


@dataclass(frozen=True)
class ProfileSettings:
    """Points of the profile, and limit of the residual; `make study` (limits, inertia) measures the effect.

    The points are at `away` standard deviations of the description's prior from nominal. A nuisance is tried
    if a point has less than `tried_share` of the mean squared residual. With an inertia 5 % off, the point on
    the right side had 0.72 to 0.95; with an inertia as described, both points had 1.06 and more wherever the
    nuisance deviated significantly (20 random fault vectors of the base setting each).
    """

    away: float = 1.0
    tried_share: float = 0.97


PROFILE = ProfileSettings()


def profile_points(
    result: SearchResult, objective: MapObjective, start: Array, jacobians: Array, name: str, step: float
) -> Array:
    """Return points (2, d) of `objective` with the nuisance below and above nominal.

    Parameters
    ----------
    result
        The estimate without the nuisance.
    objective, start, jacobians
        The objective with the nuisance, the estimate as a point (d,) of it, and the derivatives (n, d,
        channel rows) there.
    name, step
        The nuisance, and the distance of its coordinate from nominal.
    """
    correction = objective.of_channels(result.outputs_correction)
    direction = step * _response(result, objective, jacobians, objective.space.coordinates.index(name))
    starts = objective.space.project(start + np.outer([-1.0, 1.0], direction))
    return descents_from(objective, starts, correction).points


def profile(result: SearchResult, objective: MapObjective, points: Array, name: str, seed: int) -> Array:
    """Return the mean squared residuals (n,) at `points` (n, d) of `objective`, relative to that of `result`.

    `name` is the profiled nuisance, `seed` that of the runs of the reference model.
    """
    rng = stream(seed, "reference runs of a profile", name)
    comparisons = compared(objective, points, reference_problem(objective), rng)
    before = float(np.mean(result.residual[: result.objective.channel_rows] ** 2))
    return np.array([compared_power(comparison) for comparison in comparisons]) / before


def _response(result: SearchResult, objective: MapObjective, jacobians: Array, column: int) -> Array:
    """Return the change (d,) of the refitted coordinates per change of coordinate `column`, linearised."""
    variance = float(np.mean(result.residual[: objective.channel_rows] ** 2))
    prior = variance * objective.rows_of_priors / objective.space.prior_deviations**2
    normal = information(jacobians) + np.diag(prior)
    free = np.delete(np.arange(len(normal)), column)
    response = np.ones(len(normal))
    response[free] = -np.linalg.solve(normal[np.ix_(free, free)], normal[free, column])
    return response


def compared_power(comparison: SearchResult) -> float:
    """Return the mean squared residual of the channels in `comparison`, corrected for its number of runs.

    The mean of fewer than `REFERENCE_RUNS` runs of the reference model contains more switching, which is
    subtracted.
    """
    rows = comparison.objective.channel_rows
    assert comparison.discrepancy is not None  # noqa: S101 - every result of a comparison has one
    surplus = (1 - comparison.discrepancy.runs / REFERENCE_RUNS) * float(
        np.mean(comparison.discrepancy.standard_error[:rows] ** 2)
    )
    return float(np.mean(comparison.residual[:rows] ** 2)) - surplus
