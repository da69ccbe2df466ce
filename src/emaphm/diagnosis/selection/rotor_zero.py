"""Estimation of the rotor's electrical zero, relative to the recorded angle or, without one, the position.

Commutation follows the rotor; a zero that deviates from the description rotates the field relative to the
windings. A small deviation is detected by a score test of the residual (Rao 1948), a large one by the size of
the residual. A rotation of a motor with trapezoidal back-EMF by a sixth of a turn only permutes its phases
and the signs of their currents. The zero is therefore identifiable up to a sixth of a turn, and the
assignment of the phases is open.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator import NAMES, Actuator
from emaphm.arrays import Array
from emaphm.diagnosis.selection.description_errors import not_as_described, objective_with
from emaphm.diagnosis.selection.residual_share import hopelessness_relative_to, share_of_residual
from emaphm.diagnosis.selection.settings import ROTOR_ZERO
from emaphm.diagnosis.verdict import VERDICT
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search import search
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.space.parameter_space import ECCENTRICITY, SHORTS, ParameterSpace
from emaphm.estimation.uncertainty.local_covariance import jacobians_of
from emaphm.estimation.uncertainty.partial_regression import size_of_one
from emaphm.random_streams import stream
from emaphm.recording.schema import PHASES


@dataclass(frozen=True)
class RotorZeroSettings:
    """Limits from which another zero contradicts an estimate; `make study` (spoilt) measures the effect.

    The deviation is above `least` [rad, electrical] and `score` standard errors, and less than `share` of the
    mean squared residual remains with it. Ten recordings with the right zero had at most 0.002 rad and 1.5
    standard errors, except with healthy windings, where the zero is not identifiable. Six with a zero 2 rad
    off, which is 0.09 rad off for another phase, had 0.05 to 0.08 rad and 5 to 31 standard errors. `step` is
    that of the derivative.
    """

    least: float = 0.02
    score: float = 3.0
    share: float = 0.985
    step: float = 0.05


ROTOR_ZERO_SETTINGS = RotorZeroSettings()

SIXTH = np.pi / 3
"""A sixth of a turn [rad, electrical]."""

WAY_OUT = "give rotor_zero in [electrical] of the actuator's TOML"


def is_as_described(objective: MapObjective) -> bool:
    """Return whether the rotor's zero rests on the description alone and may deviate.

    If the current was computed from three phases with the recorded angle, another zero would also give
    another current; a drive without commutation needs the recorded angle including its zero.
    """
    actuator, measured = objective.problem.actuator, objective.problem.measured
    has_phases = all(name in measured for name in PHASES)
    is_known = "angle_rad" in measured and (has_phases or not actuator.commutates)
    return actuator.electrical is not None and ROTOR_ZERO not in not_as_described(objective) and not is_known


def zero_deviation(result: SearchResult, jacobians: Array) -> float:
    """Return the deviation of the rotor's zero by the score test [rad, electrical]; 0 if not significant.

    `jacobians` (n, d, channel rows) are those at the estimate.
    """
    objective, settings = result.objective, ROTOR_ZERO_SETTINGS
    if not is_as_described(objective):
        return 0.0
    low, high = (
        with_rotor_at(objective, deviation).outputs(result.point[np.newaxis])[0, : objective.channel_rows]
        for deviation in (-settings.step, settings.step)
    )
    size, error = size_of_one(result, jacobians, (high - low) / (2 * settings.step))
    return size if abs(size) > max(settings.least, settings.score * error) else 0.0


def with_rotor_at(objective: MapObjective, electrical_rad: float) -> MapObjective:
    """Return the objective with the rotor's zero changed by `electrical_rad`."""
    problem = objective.problem
    offset = problem.start.rotor_offset + electrical_rad / problem.actuator.pole_pairs
    start = replace(problem.start, rotor_offset=offset)
    return replace(objective, problem=replace(problem, start=start))


def with_rotor_zero(searched: SearchResult, settings: SearchSettings) -> SearchResult:
    """Return the estimate with the rotor's zero free, if the recording indicates that it deviates.

    This is the case if only another zero explains the recording, or if the residual with it is clearly
    smaller. Otherwise `searched` is returned; or, if the new search explains the recording with a zero close
    to the description, the estimate with the described zero from its end point.
    """
    if not is_zero_searched(searched.objective):
        return searched
    if searched.residual_is_expected and not (
        _phases_differ(searched) and _is_deviation_significant(searched, settings.seed)
    ):
        return searched
    freed = with_zero_near(searched, 0.0, settings)
    if not freed.residual_is_expected:
        return searched
    if searched.residual_is_expected and share_of_residual(freed, searched) >= ROTOR_ZERO_SETTINGS.share:
        return searched
    if abs(zero_of(freed)) > ROTOR_ZERO_SETTINGS.least:
        return freed
    start = searched.objective.space.carried_over(freed.point, freed.objective.space)
    child = settings.child("the rotor's zero, as described")
    as_described = correct_bias(searched.objective, start[np.newaxis], child.max_corrections, child.seed)
    return as_described if as_described.residual_is_expected else searched


def is_zero_searched(objective: MapObjective) -> bool:
    """Return whether the rotor's zero is identifiable and may deviate."""
    return objective.problem.actuator.commutates and is_as_described(objective)


def with_zero_near(searched: SearchResult, near: float, settings: SearchSettings) -> SearchResult:
    """Return the estimate with the rotor's zero free: the solution nearest to `near` [rad, electrical].

    Solutions are a sixth of a turn apart; with the same `near`, several recordings have the same assignment
    of phases. The search stops early if the residual of `searched` is hardly reduced.
    """
    actuator, child = searched.objective.problem.actuator, settings.child("the rotor's zero")
    freed = search(
        objective_with(searched.objective, (ROTOR_ZERO,)),
        child,
        fitness="least_squares",
        is_hopeless=hopelessness_relative_to(searched),
    )
    sixths = round((zero_of(freed) - near) / SIXTH)
    if not sixths:
        return freed
    start = with_phases_renamed(freed.objective.space, freed.point, actuator, sixths)
    return correct_bias(freed.objective, start[np.newaxis], child.max_corrections, child.seed)


def zero_of(result: SearchResult) -> float:
    """Return the estimated deviation of the rotor's zero from the description [rad, electrical]."""
    return float(result.objective.space.nuisance_values(result.point[np.newaxis])[BASELINE + ROTOR_ZERO][0])


def with_phases_renamed(space: ParameterSpace, point: Array, actuator: Actuator, sixths: int) -> Array:
    """Return the point (d,) of the same motor with permuted phases: its zero is `sixths` of a turn less.

    For one sixth less, the new phases a, b, c are the former c, a, b. The eccentricity keeps its position in
    the machine.
    """
    faults = space.faults(point)
    shorts = [NAMES.index(name) for name in SHORTS]
    faults[shorts] = np.roll(faults[shorts], sixths)
    turned = sixths * (SIXTH / actuator.pole_pairs - 2 * SIXTH)
    direction = NAMES.index("eccentricity_phase")
    faults[direction] = (faults[direction] + turned / (2 * np.pi)) % 1.0
    nuisances, first = space.nuisances, len(space.columns)
    renamed = space.points(faults)
    renamed[first:] = point[first:]
    column = nuisances.names.index(BASELINE + ROTOR_ZERO)
    row = nuisances.quantities.index(BASELINE + ROTOR_ZERO)
    renamed[first + column] -= sixths * SIXTH / nuisances.meaning[row, column]
    return space.project(renamed)


def _phases_differ(result: SearchResult) -> bool:
    """Return whether a short or an eccentricity makes the phases differ, so that the zero affects faults."""
    faults = result.objective.space.faults(result.point)
    return any(faults[NAMES.index(name)] > VERDICT.healthy_margin for name in (*SHORTS, ECCENTRICITY[0]))


def _is_deviation_significant(result: SearchResult, seed: int) -> bool:
    """Return whether the score test indicates a deviation of the rotor's zero."""
    return zero_deviation(result, jacobians_of(result, stream(seed, "Jacobians of the rotor's zero"))) != 0.0
