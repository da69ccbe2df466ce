"""Gains of the drive's control loops that are not as described, and parts that the description lacks.

Drives have them in units of their own, tune them by themselves, or keep them to themselves. The current then
answers to its demand, or the demand to the speed, sooner or later than the model's. Where that is large the
residual exceeds what is expected, and all gains are asked for at once. Where it is small the faults take it
up: of the current's control the residual shows that by its direction (Rao 1948: a score test); of the
speed's, `description_errors` asks for what makes up for it.
"""

from collections.abc import Sequence

import numpy as np

from emaphm.actuator.actuator import described_parts
from emaphm.actuator.laws import LAWS
from emaphm.diagnosis.selection.description_errors import not_as_described, objective_with, with_free
from emaphm.diagnosis.selection.laws.law_fit import search_with_law, without_law
from emaphm.diagnosis.selection.residual_share import share_of_residual
from emaphm.diagnosis.selection.selection import Selection
from emaphm.diagnosis.selection.settings import CONTROL_ERRORS, CURRENT_CONTROL, SELECTION, SPEED_CONTROL
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.uncertainty.local_covariance import jacobians_of
from emaphm.estimation.uncertainty.partial_regression import regressed
from emaphm.random_streams import stream
from emaphm.threads import in_threads

LIKE_A_DELAY = ("command-lag", "feedforward")
CONTROL_LAWS = ("speed-integral", "position-integral", *LIKE_A_DELAY)
"""Parts of the control that a description may lack."""

CONTROL = (*SPEED_CONTROL, *CURRENT_CONTROL)


def as_described(objective: MapObjective, names: Sequence[str]) -> tuple[str, ...]:
    """Return those of the control's parameters `names` that rest on the description alone."""
    actuator, known = objective.problem.actuator, not_as_described(objective)
    return tuple(name for name in names if name not in known and any(described_parts(actuator, name) or ()))


def with_control_errors(searched: SearchResult, settings: SearchSettings) -> SearchResult:
    """Return the estimate with gains of the control free, where the recording shows that they are off.

    Where its residual is expected, those of the current control that it shows; where it is not, all. They
    must leave clearly less than `searched`, which is returned as it is elsewhere; and than the search without
    them from where they lead, which is returned where it has only found its way better.
    """
    names, least = _asked_for(searched, settings.seed)
    if not names:
        return searched
    found = with_free(searched, names, settings)
    if not found.residual_is_expected:
        least = 0.0 if searched.residual_is_expected else CONTROL_ERRORS.excess_share
    if share_of_residual(found, searched) >= least or _may_be_another_gear(found):
        return searched
    back = without_law(found, searched, settings)
    if share_of_residual(found, back) < least:
        return found
    return back if back.residual_is_expected else searched


def with_control_law(searched: SearchResult, found: Selection, settings: SearchSettings) -> Selection | None:
    """Return the estimate with a law of the control from that `searched` without one.

    `found` has the nuisances that were selected without laws. Where they do not explain the recording, the
    law is returned that leaves least, if that is no more than noise: other laws are tried elsewhere, and
    compared with it. A command that lags looks like channels that come late, a feedforward like early ones:
    where a delay was selected that explains the recording, only these two are tried.
    """
    laws = (
        CONTROL_LAWS
        if not found.result.residual_is_expected
        else LIKE_A_DELAY
        if "delay" in found.nuisances
        else ()
    )
    possible = [name for name in laws if LAWS[name].is_possible(searched.objective.problem.actuator)]
    tried = in_threads(
        lambda name: search_with_law(searched, name, settings),
        possible,
        searched.objective.problem.workers,
    )
    convincing = {
        name: one
        for name, one in zip(possible, tried, strict=True)
        if one.residual_is_expected and one.normalised_residual < CONTROL_ERRORS.convincing
    }
    if not convincing:
        return None
    name = min(convincing, key=lambda one: convincing[one].residual_variance)
    return Selection(convincing[name], laws=(name,))


def contradicted_control(result: SearchResult, seed: int) -> tuple[str, ...]:
    """Return the gains of the current control if the residual shows one of them to be off."""
    return _shown(result, seed)[0]


def _may_be_another_gear(found: SearchResult) -> bool:
    """Return whether another gear ratio is as likely as the speed gain that was estimated.

    With c times the gear ratio, a current is as before where the speed gain is c times as large, and the
    position gain, the torque constant and the friction 1 / c times: shorts and a lower friction make up for
    that. The line voltage and the motion do not.
    """
    values = found.objective.space.nuisance_values(found.point[np.newaxis])
    off = float(np.abs(values.get(BASELINE + SPEED_CONTROL[0], np.zeros(1)))[0])
    return len(found.objective.problem.channels) == 1 and off > CONTROL_ERRORS.most_alone


def _asked_for(searched: SearchResult, seed: int) -> tuple[tuple[str, ...], float]:
    """Return the gains that are asked for, and what share of the residual they may leave."""
    if not searched.residual_is_expected:
        return as_described(searched.objective, CONTROL), SELECTION.likely_share
    names, score = _shown(searched, seed)
    return names, 1.0 if score > CONTROL_ERRORS.certain else SELECTION.likely_share


def _shown(result: SearchResult, seed: int) -> tuple[tuple[str, ...], float]:
    """Return the gains of the current control if the residual shows one of them to be off, and the score."""
    names = as_described(result.objective, CURRENT_CONTROL)
    score = _score(result, names, seed) if names else 0.0
    return names if score > CONTROL_ERRORS.likely else (), score


def _score(result: SearchResult, names: tuple[str, ...], seed: int) -> float:
    """Return by how many standard errors the residual shows one of `names` to be off: the largest.

    0 where none is off by as much as is asked for, and for a unit whose model error was learned: what is left
    of its recordings has directions of its own.
    """
    objective, step = result.objective, CONTROL_ERRORS.step
    learned = objective.problem.actuator.model_error
    if any(learned.of(name) for name in objective.problem.channels):
        return 0.0
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
