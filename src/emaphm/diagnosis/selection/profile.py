"""What the reference model says of a nuisance off nominal, the other parameters following.

With a wrong inertia, the search by the averaged model ends among faults that make up for it. The kinks of
stick-slip hold its descents there, and what they leave of the residual at the right inertia is within a
percent or two of what they leave at the wrong one. The reference model separates the two: what it has that
the averaged model has not depends on the parameters too. It is asked either way of nominal, where the other
parameters are what the data prefer there: two points of the profile likelihood (Cox and Hinkley 1974, ch. 9).
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
"""Nuisances that the reference model is asked for: faults make up for them in the averaged model."""


@dataclass(frozen=True)
class ProfileSettings:
    """Where the reference model is asked; `make study` (limits, inertia) measures it.

    At `away` standard deviations of the description's prior either way. One is worth trying where it leaves
    less than `tried_share` of the mean squared residual. With an inertia 5 % off, the right side left 0.72 to
    0.95, with one as described both left 1.06 and more wherever the nuisance was significantly off (20 random
    fault vectors of the base setting each).
    """

    away: float = 1.0
    tried_share: float = 0.97


PROFILE = ProfileSettings()


def profile_points(
    result: SearchResult, objective: MapObjective, start: Array, jacobians: Array, name: str, step: float
) -> Array:
    """Return points (2, d) of `objective` either way of nominal.

    Parameters
    ----------
    result
        The estimate without the nuisance.
    objective, start, jacobians
        With it: what is minimised, the estimate as a point (d,) of it, and the derivatives (n, d, channel
        rows) there.
    name, step
        The nuisance, and how far its coordinate is moved.
    """
    correction = objective.of_channels(result.outputs_correction)
    moved = step * _response(result, objective, jacobians, objective.space.coordinates.index(name))
    starts = objective.space.project(start + np.outer([-1.0, 1.0], moved))
    return descents_from(objective, starts, correction).points


def profile(result: SearchResult, objective: MapObjective, points: Array, name: str, seed: int) -> Array:
    """Return the shares (n,) of the residual of `result` at `points` (n, d) of `objective`, which has `name`.

    `seed` is for the runs of the reference model.
    """
    rng = stream(seed, "reference runs of a profile", name)
    comparisons = compared(
        objective, np.zeros_like(objective.target), points, reference_problem(objective), rng
    )
    before = float(np.mean(result.residual[: result.objective.channel_rows] ** 2))
    return np.array([compared_power(one) for one in comparisons]) / before


def _response(result: SearchResult, objective: MapObjective, jacobians: Array, column: int) -> Array:
    """Return how all coordinates (d,) follow one of them, which moves by 1: by the linear model."""
    variance = float(np.mean(result.residual[: objective.channel_rows] ** 2))
    prior = variance * objective.rows_of_priors / objective.space.prior_deviations**2
    normal = information(jacobians) + np.diag(prior)
    others = np.delete(np.arange(len(normal)), column)
    response = np.ones(len(normal))
    response[others] = -np.linalg.solve(normal[np.ix_(others, others)], normal[others, column])
    return response


def compared_power(result: SearchResult) -> float:
    """Return the mean squared residual of the channels in `result`, a result of a comparison.

    Less what a mean over so few runs of the reference model has more of its switching than one over all.
    """
    rows = result.objective.channel_rows
    assert result.discrepancy is not None  # noqa: S101 - every result of a comparison has one
    surplus = (1 - result.discrepancy.runs / REFERENCE_RUNS) * float(
        np.mean(result.discrepancy.standard_error[:rows] ** 2)
    )
    return float(np.mean(result.residual[:rows] ** 2)) - surplus
