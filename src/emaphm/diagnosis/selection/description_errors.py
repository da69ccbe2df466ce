"""Parameters of the description that are off, although faults or sensors make up for them.

Two kinds show in an estimate whose residual is expected.

- The motion of a drive stays as it is where the gain of its speed loop, all torques and the inertia change by
  one factor: the current changes by it. So a speed gain that is a tenth off reads as a current of another
  scale, an inertia and a friction. One parameter that is off is likelier than a sensor and the inertia, or
  two sensors, at once.
- Shorts of all phases lower the torque constant by a share, the resistance by the same one, the inductance by
  twice that. So they take up a torque constant that is off, and leave an inductance that contradicts it: the
  residual's regression on the derivative by the inductance shows it (a score test, Rao 1948). Which of the
  motor's parameters are off does not show: all are estimated, and intervals of shorts are as wide as that.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.actuator import NAMES
from emaphm.actuator.actuator import described_parts
from emaphm.diagnosis.selection.laws.law_fit import Fit, with_open
from emaphm.diagnosis.selection.profile import INERTIA
from emaphm.diagnosis.selection.settings import (
    CURRENT_CONTROL,
    DESCRIPTION_ERRORS,
    MOTOR,
    ROTOR_ZERO,
    SPEED_CONTROL,
)
from emaphm.diagnosis.verdict import VERDICT
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.space.parameter_space import SHORTS
from emaphm.estimation.space.parameter_variation import ParameterVariation
from emaphm.estimation.uncertainty.local_covariance import jacobians_of
from emaphm.estimation.uncertainty.partial_regression import size_of_one
from emaphm.random_streams import stream

SPEED_LOOP = ("speed_gain",)
INDUCTANCE = "inductance"

MADE_UP_BY, OF_THE_CLOCK = (INERTIA, "current_scale", "voltage_scale"), ("position_scale", "speed_scale")
"""Nuisances of which two together may be a speed gain; and those that say rather that times are wrong."""


@dataclass(frozen=True)
class PossibleError:
    """Parameters of the description that are asked for together.

    Whether one is `certain` to be off, and nuisances that they would be `instead_of`: none of these is left.
    """

    parameters: tuple[str, ...]
    certain: bool = False
    instead_of: tuple[str, ...] = ()


def possible_errors(result: SearchResult, names: Sequence[str], seed: int) -> list[PossibleError]:
    """Return what may be off where the residual of `result` is expected.

    `names` are the nuisances that were selected for it. Not asked for is what the actuator does not have,
    what a calibration has found, and what is open anyway; nor the motor where a phase is healthy and no
    inertia or scale was selected: nothing has taken up a torque constant then.
    """
    actuator, known = result.objective.problem.actuator, not_as_described(result.objective)

    def possible(parameters: tuple[str, ...]) -> bool:
        described = all(described_parts(actuator, name) is not None for name in parameters)
        return described and not set(parameters) & set(known)

    if set(names) & set(OF_THE_CLOCK):
        return []
    found = []
    if len(set(names) & set(MADE_UP_BY)) > 1 and possible(SPEED_LOOP):
        found.append(PossibleError(SPEED_LOOP, instead_of=MADE_UP_BY))
    if possible(MOTOR) and (set(names) & set(MADE_UP_BY) or _all_shorted(result)):
        score = inductance_score(result, seed)
        if score > DESCRIPTION_ERRORS.likely:
            found.append(PossibleError(MOTOR, score > DESCRIPTION_ERRORS.certain))
    return found


def not_as_described(objective: MapObjective) -> tuple[str, ...]:
    """Return the parameters that do not rest on the description alone: those open, and those calibrated."""
    baseline = objective.problem.actuator.baseline
    return (*objective.space.nuisances.parameters, *(baseline.names if baseline else ()))


def _all_shorted(result: SearchResult) -> bool:
    """Return whether all phases seem to have a short."""
    faults = result.objective.space.faults(result.point)
    return all(faults[NAMES.index(name)] > VERDICT.healthy_margin for name in SHORTS)


def inductance_score(result: SearchResult, seed: int) -> float:
    """Return by how many standard errors the residual shows another inductance than described.

    0 where it is off by less than what is asked for.
    """
    objective = result.objective
    jacobians = jacobians_of(result, stream(seed, "Jacobians of the description"))
    extended = objective_with(objective, (INDUCTANCE,))
    point = extended.space.carried_over(result.point, objective.space)
    ends = np.tile(point, (2, 1))
    ends[:, -1] = -DESCRIPTION_ERRORS.step, DESCRIPTION_ERRORS.step
    low, high = extended.outputs(ends)[:, : objective.channel_rows]
    derivative = (high - low) / (2 * DESCRIPTION_ERRORS.step)
    size, error = size_of_one(result, jacobians, derivative)
    return abs(size) / error if abs(size) > DESCRIPTION_ERRORS.least else 0.0


def with_free(searched: SearchResult, parameters: tuple[str, ...], settings: SearchSettings) -> SearchResult:
    """Return the estimate with `parameters` of the description free, from that `searched` without them."""
    child = settings.child("error of the description", *parameters)
    objective = objective_with(searched.objective, parameters)
    return Fit.of(searched, objective, parameters[0], child).corrected(child)


def suspected_parameters(result: SearchResult) -> tuple[str, ...]:
    """Return the names, among the quantities of `result`, of parameters that were estimated unasked."""
    actuator, parameters = result.objective.problem.actuator, result.objective.space.nuisances.parameters
    asked = ParameterVariation.of_unit(actuator).parameters
    suspects = (*SPEED_CONTROL, *MOTOR, ROTOR_ZERO, *CURRENT_CONTROL)
    return tuple(BASELINE + name for name in suspects if name in parameters and name not in asked)


def objective_with(objective: MapObjective, parameters: tuple[str, ...]) -> MapObjective:
    """Return the objective with parameters of its actuator free."""
    actuator = objective.problem.actuator
    priors = {name: DESCRIPTION_ERRORS.prior_of(name) for name in parameters}
    return with_open(objective, actuator, ParameterVariation.free(actuator, parameters).known_to(priors))
