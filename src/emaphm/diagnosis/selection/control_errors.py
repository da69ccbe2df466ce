"""Gains of the drive's control loops that deviate from the description, and missing parts of the control.

Drives have gains in their own units, tune them automatically, or do not disclose them. The current then
responds to its demand, or the demand to the speed, faster or slower than in the model. If this deviation is
large, the residual exceeds the expected size, and all gains are estimated together. If it is small, faults
compensate for it. A score test (Rao 1948) detects this for the gains of the current control; for those of the
speed control, `description_errors` tests the nuisances that compensate for them.
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
"""Laws with an effect similar to late, or early, channels."""

CONTROL_LAWS = ("speed-integral", "position-integral", *LIKE_A_DELAY)
"""Parts of the control that a description may lack."""

CONTROL = (*SPEED_CONTROL, *CURRENT_CONTROL)


def as_described(objective: MapObjective, names: Sequence[str]) -> tuple[str, ...]:
    """Return the parameters among `names` that the drive has and that are neither free nor calibrated."""
    actuator, known = objective.problem.actuator, not_as_described(objective)
    return tuple(name for name in names if name not in known and any(described_parts(actuator, name) or ()))


def with_control_errors(searched: SearchResult, settings: SearchSettings) -> SearchResult:
    """Return the estimate with gains of the control free, if the recording indicates that they deviate.

    If the residual of `searched` is expected, the gains of the current control are tested; otherwise all
    gains. Their estimate must have a clearly smaller residual than `searched`, and than the search without
    them from its end point. If only that repeated search explains the recording, its result is returned;
    otherwise `searched`.
    """
    names, largest_share = _suspected_gains(searched, settings.seed)
    if not names:
        return searched
    freed = with_free(searched, names, settings)
    if not freed.residual_is_expected:
        largest_share = 0.0 if searched.residual_is_expected else CONTROL_ERRORS.excess_share
    if share_of_residual(freed, searched) >= largest_share or _may_be_another_gear(freed):
        return searched
    repeated = without_law(freed, searched, settings)
    if share_of_residual(freed, repeated) < largest_share:
        return freed
    return repeated if repeated.residual_is_expected else searched


def with_control_law(searched: SearchResult, found: Selection, settings: SearchSettings) -> Selection | None:
    """Return the estimate with a law of the control, from the estimate `searched` without one; or None.

    `found` contains the nuisances that were selected without laws. If they do not explain the recording, the
    law with the smallest residual is returned, if its residual is no more than noise: other laws are tested
    elsewhere and compared with it. A lag of the command has an effect similar to late channels, a feedforward
    to early channels: if a delay was selected that explains the recording, only these two laws are tested.
    """
    laws = (
        CONTROL_LAWS
        if not found.result.residual_is_expected
        else LIKE_A_DELAY
        if "delay" in found.nuisances
        else ()
    )
    possible = [name for name in laws if LAWS[name].is_possible(searched.objective.problem.actuator)]
    estimates = in_threads(
        lambda name: search_with_law(searched, name, settings),
        possible,
        searched.objective.problem.workers,
    )
    accepted = {
        name: estimate
        for name, estimate in zip(possible, estimates, strict=True)
        if estimate.residual_is_expected and estimate.normalised_residual < CONTROL_ERRORS.convincing
    }
    if not accepted:
        return None
    name = min(accepted, key=lambda law: accepted[law].residual_variance)
    return Selection(accepted[name], laws=(name,))


def contradicted_control(result: SearchResult, seed: int) -> tuple[str, ...]:
    """Return the gains of the current control if the score test indicates a deviation of one; else none."""
    return _gains_by_score(result, seed)[0]


def _may_be_another_gear(estimate: SearchResult) -> bool:
    """Return whether another gear ratio is as likely as the estimated speed gain.

    From the current alone, c times the gear ratio has the same effect as c times the speed gain and 1 / c of
    position gain, torque constant and friction, for which shorts and a lower friction compensate. Line
    voltage and motion separate the two.
    """
    values = estimate.objective.space.nuisance_values(estimate.point[np.newaxis])
    deviation = float(np.abs(values.get(BASELINE + SPEED_CONTROL[0], np.zeros(1)))[0])
    return len(estimate.objective.problem.channels) == 1 and deviation > CONTROL_ERRORS.most_alone


def _suspected_gains(searched: SearchResult, seed: int) -> tuple[tuple[str, ...], float]:
    """Return the gains to estimate, and the largest share of the residual with which they are kept."""
    if not searched.residual_is_expected:
        return as_described(searched.objective, CONTROL), SELECTION.likely_share
    names, score = _gains_by_score(searched, seed)
    return names, 1.0 if score > CONTROL_ERRORS.certain else SELECTION.likely_share


def _gains_by_score(result: SearchResult, seed: int) -> tuple[tuple[str, ...], float]:
    """Return the gains of the current control if the score test indicates a deviation, and the score."""
    names = as_described(result.objective, CURRENT_CONTROL)
    score = _largest_score(result, names, seed) if names else 0.0
    return names if score > CONTROL_ERRORS.likely else (), score


def _largest_score(result: SearchResult, names: tuple[str, ...], seed: int) -> float:
    """Return the largest deviation of the parameters `names`, in standard errors, by a score test.

    Deviations below `CONTROL_ERRORS.least` count as 0, and so do all of a unit whose model error was learned:
    its residuals may have the direction of a gain.
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
