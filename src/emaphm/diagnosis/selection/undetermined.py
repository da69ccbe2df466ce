"""A parameter of the description that a recording cannot tell from faults: they have room for what it may be.

From the current alone, an inertia 5 % off reads as another friction, and leaves nothing of the residual by
which it could be selected. The estimate stays that of the description, which is the most probable. But the
description also says how well the parameter is known: its coordinate, with that prior, gives the covariance
what faults would make up for (a "consider" parameter: Schmidt 1966).
"""

from emaphm.diagnosis.selection.extension import with_nuisances
from emaphm.diagnosis.selection.profile import PROFILED
from emaphm.estimation.nuisances import PRIORS_PER_UNIT
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import jacobians_at, local_covariance
from emaphm.random_streams import child_seed, stream

UNDETERMINED = 0.4
"""Share of the prior's standard deviation that the data leave of a parameter which they do not determine.
From the current alone they left 0.96 of the inertia's in 15 of 17 recordings, with the line voltage 0.05 to
0.39 in 10 (random faults)."""


def with_undetermined(result: SearchResult, seed: int) -> SearchResult:
    """Return the result with the inertia among its coordinates, where the recording does not determine it."""
    nuisances, problem = result.objective.space.nuisances, result.objective.problem
    for name in nuisances.others(problem.actuator, tuple(problem.measured)):
        if name in PROFILED:
            extended = result.in_space(*with_nuisances(result, (), (name,), 1.0))
            # Kinks of stick-slip make chance of derivatives: once in some twenty, they show nothing.
            if all(_is_undetermined(extended, name, child_seed(seed, "draw", str(i))) for i in range(2)):
                result = extended
    return result


def _is_undetermined(result: SearchResult, name: str, seed: int) -> bool:
    """Return whether the data leave more of `name`, a coordinate, than a share of its prior."""
    objective, i = result.objective, result.objective.space.coordinates.index(name)
    jacobians = jacobians_at(
        objective, result.point, stream(seed, "Jacobians of what is not determined", name)
    )
    residual = result.residual[: objective.channel_rows]
    covariance = local_covariance(objective, result.point, residual, jacobians).covariance
    return bool(covariance[i, i] ** 0.5 > UNDETERMINED / PRIORS_PER_UNIT)
