"""A rotor whose electrical zero is not where the recorded angle, or without one the position, puts it.

Commutation follows the rotor, and a zero that is not as described turns the field against the windings. The
residual shows that: by its direction where the error is small (Rao 1948: a score test), by its size where it
is not. A motor with trapezoidal back-EMF is the same six times a turn but for the names of its phases and the
signs of their currents, so the zero is found up to a sixth of a turn, and which phase is which stays open.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator import NAMES, Actuator
from emaphm.arrays import Array
from emaphm.diagnosis.selection.description_errors import not_as_described, objective_with
from emaphm.diagnosis.selection.residual_share import hopeless_next_to, share_of_residual
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
    """From when on another zero contradicts an estimate; `make study` (spoilt) measures it.

    An error above `least` [rad, electrical] and `score` standard errors, with which less than `share` of the
    mean squared residual is left. Ten recordings whose zero was right had 0.002 rad and 1.5 standard errors
    at most, but for healthy windings, where none shows; six with one 2 rad off, which is 0.09 rad off for
    another phase, 0.05 to 0.08 rad and 5 to 31. `step` is that of the derivative.
    """

    least: float = 0.02
    score: float = 3.0
    share: float = 0.985
    step: float = 0.05


ROTOR_ZERO_SETTINGS = RotorZeroSettings()

SIXTH = np.pi / 3
"""Of a turn [rad, electrical]."""

WAY_OUT = "give rotor_zero in [electrical] of the actuator's TOML"


def is_as_described(objective: MapObjective) -> bool:
    """Return whether the rotor's zero rests on the description alone, and could be another.

    Where the current was made of three phases by the recorded angle, that would be another current too; and
    a drive without commutation needs the angle's zero itself.
    """
    actuator, measured = objective.problem.actuator, objective.problem.measured
    of_phases = all(name in measured for name in PHASES)
    known = "angle_rad" in measured and (of_phases or not actuator.commutates)
    return actuator.electrical is not None and ROTOR_ZERO not in not_as_described(objective) and not known


def zero_shown(result: SearchResult, jacobians: Array) -> float:
    """Return by how much the residual shows another zero of the rotor [rad, electrical]; 0 if it does not.

    `jacobians`, (n, d, channel rows), are the estimate's.
    """
    objective, settings = result.objective, ROTOR_ZERO_SETTINGS
    if not is_as_described(objective):
        return 0.0
    low, high = (
        with_rotor_at(objective, end).outputs(result.point[np.newaxis])[0, : objective.channel_rows]
        for end in (-settings.step, settings.step)
    )
    size, error = size_of_one(result, jacobians, (high - low) / (2 * settings.step))
    return size if abs(size) > max(settings.least, settings.score * error) else 0.0


def with_rotor_at(objective: MapObjective, electrical_rad: float) -> MapObjective:
    """Return the objective whose rotor is `electrical_rad` farther from the position's zero."""
    problem = objective.problem
    offset = problem.start.rotor_offset + electrical_rad / _poles(problem.actuator)
    start = replace(problem.start, rotor_offset=offset)
    return replace(objective, problem=replace(problem, start=start))


def with_rotor_zero(searched: SearchResult, settings: SearchSettings) -> SearchResult:
    """Return the estimate with the rotor's zero, where the recording shows that it is not as described.

    That is where only another one explains it, or one leaves clearly less; elsewhere `searched` as it is, or
    what it would have been where the new search has only found its way better.
    """
    if not is_sought(searched.objective):
        return searched
    if searched.residual_is_expected and not (
        _phases_differ(searched) and _shows_zero(searched, settings.seed)
    ):
        return searched
    found = with_zero_near(searched, 0.0, settings)
    if not found.residual_is_expected:
        return searched
    if searched.residual_is_expected and share_of_residual(found, searched) >= ROTOR_ZERO_SETTINGS.share:
        return searched
    if abs(zero_of(found)) > ROTOR_ZERO_SETTINGS.least:
        return found
    start = searched.objective.space.carried_over(found.point, found.objective.space)
    child = settings.child("the rotor's zero, as described")
    as_described = correct_bias(searched.objective, start[np.newaxis], child.max_corrections, child.seed)
    return as_described if as_described.residual_is_expected else searched


def is_sought(objective: MapObjective) -> bool:
    """Return whether a recording may show another zero of the rotor, and which."""
    return objective.problem.actuator.commutates and is_as_described(objective)


def with_zero_near(searched: SearchResult, near: float, settings: SearchSettings) -> SearchResult:
    """Return the estimate with the rotor's zero free: the one that is nearest to `near` [rad, electrical].

    Of all that are a sixth of a turn apart, so that the phases of several recordings have the same names. It
    is searched for once where that leaves hardly less of what `searched` does not explain.
    """
    actuator, child = searched.objective.problem.actuator, settings.child("the rotor's zero")
    found = search(
        objective_with(searched.objective, (ROTOR_ZERO,)),
        child,
        fitness="least_squares",
        is_hopeless=hopeless_next_to(searched),
    )
    sixths = round((zero_of(found) - near) / SIXTH)
    if not sixths:
        return found
    start = with_phases_renamed(found.objective.space, found.point, actuator, sixths)
    return correct_bias(found.objective, start[np.newaxis], child.max_corrections, child.seed)


def zero_of(result: SearchResult) -> float:
    """Return the rotor's zero that was estimated, from the described one [rad, electrical]."""
    return float(result.objective.space.nuisance_values(result.point[np.newaxis])[BASELINE + ROTOR_ZERO][0])


def with_phases_renamed(space: ParameterSpace, point: Array, actuator: Actuator, sixths: int) -> Array:
    """Return the point (d,) of the same motor by other names of its phases: its zero `sixths` of a turn less.

    A sixth less, and a is what c was, b what a was, c what b was. The eccentricity keeps its place in the
    machine.
    """
    faults = space.faults(point)
    shorts = [NAMES.index(name) for name in SHORTS]
    faults[shorts] = np.roll(faults[shorts], sixths)
    turned = sixths * (SIXTH / _poles(actuator) - 2 * SIXTH)
    direction = NAMES.index("eccentricity_phase")
    faults[direction] = (faults[direction] + turned / (2 * np.pi)) % 1.0
    nuisances, first = space.nuisances, len(space.columns)
    renamed = space.points(faults)
    renamed[first:] = point[first:]
    column = nuisances.names.index(BASELINE + ROTOR_ZERO)
    row = nuisances.quantities.index(BASELINE + ROTOR_ZERO)
    renamed[first + column] -= sixths * SIXTH / nuisances.meaning[row, column]
    return space.project(renamed)


def _poles(actuator: Actuator) -> int:
    return actuator.electrical.pole_pairs if actuator.electrical else 1


def _phases_differ(result: SearchResult) -> bool:
    """Return whether a short or an eccentricity makes phases differ: without, a zero matters to no fault."""
    faults = result.objective.space.faults(result.point)
    return any(faults[NAMES.index(name)] > VERDICT.healthy_margin for name in (*SHORTS, ECCENTRICITY[0]))


def _shows_zero(result: SearchResult, seed: int) -> bool:
    return zero_shown(result, jacobians_of(result, stream(seed, "Jacobians of the rotor's zero"))) != 0.0
