"""Gains of the drive's control loops that are not as described.

Drives have them in units of their own, tune them by themselves, or keep them to themselves. The current then
answers to its demand, or the demand to the speed, sooner or later than the model's. Where that is large the
recording is not explained, and all gains are asked for at once. Where it is small the faults take it up: of
the current's control the residual shows that by its direction (Rao 1948: a score test); of the speed's,
`description_errors` asks for what makes up for it.
"""

from collections.abc import Sequence

import numpy as np

from emaphm.actuator.actuator import described_parts
from emaphm.diagnosis.selection.description_errors import objective_with, with_free
from emaphm.diagnosis.selection.nuisance_selection import share_of_residual
from emaphm.diagnosis.selection.settings import CONTROL_ERRORS, CURRENT_CONTROL, SELECTION, SPEED_CONTROL
from emaphm.estimation.methods import Method
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import jacobians_of
from emaphm.estimation.uncertainty.partial_regression import regressed
from emaphm.random_streams import stream

CONTROL = (*SPEED_CONTROL, *CURRENT_CONTROL)


def as_described(objective: MapObjective, names: Sequence[str]) -> tuple[str, ...]:
    """Return those of the control's parameters `names` that rest on the description alone."""
    actuator = objective.problem.actuator
    known = (*objective.space.nuisances.parameters, *(actuator.baseline.names if actuator.baseline else ()))
    return tuple(name for name in names if name not in known and any(described_parts(actuator, name) or ()))


def with_control_errors(
    searched: SearchResult, method: Method, max_corrections: int, seed: int
) -> SearchResult:
    """Return the estimate with gains of the control free, where the recording shows that they are off.

    Where it is explained, those of the current control that the residual shows; where it is not, all, if they
    leave clearly less. Elsewhere `searched` as it is.
    """
    if searched.explained:
        names = contradicted_control(searched, seed)
        least = SELECTION.likely_share, 0.0
    else:
        names = as_described(searched.objective, CONTROL)
        least = SELECTION.likely_share, CONTROL_ERRORS.unexplained_share
    if not names:
        return searched
    found = with_free(searched, names, method, max_corrections, seed)
    return found if share_of_residual(found, searched) < least[not found.explained] else searched


def contradicted_control(result: SearchResult, seed: int) -> tuple[str, ...]:
    """Return the gains of the current control if the residual shows one of them to be off."""
    names = as_described(result.objective, CURRENT_CONTROL)
    return names if names and _score(result, names, seed) > CONTROL_ERRORS.score else ()


def _score(result: SearchResult, names: tuple[str, ...], seed: int) -> float:
    """Return by how many standard errors the residual shows one of `names` to be off: the largest.

    0 where none is off by as much as is asked for.
    """
    objective, step = result.objective, CONTROL_ERRORS.step
    extended = objective_with(objective, names)
    point = extended.space.carried_over(result.point, objective.space)
    steps = step * np.eye(len(point))[-len(names) :]
    rows = extended.outputs(np.vstack([point - steps, point + steps]))[:, : objective.channel_rows]
    low, high = np.split(rows, 2)
    _, sizes, covariance = regressed(
        jacobians_of(result, stream(seed, "Jacobians of the control")).mean(axis=0),
        (high - low) / (2 * step),
        result.residual[: objective.channel_rows],
        objective.problem,
    )
    scores = np.abs(sizes) / np.sqrt(np.diag(covariance))
    return float(np.max(scores, initial=0.0, where=np.abs(sizes) > CONTROL_ERRORS.least))
