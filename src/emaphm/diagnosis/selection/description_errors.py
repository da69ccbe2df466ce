"""Parameters of the description that deviate although faults or sensor errors compensate for them.

Two kinds are detectable in an estimate whose residual is expected.

- If the gain of the speed loop, all torques and the inertia change by one factor, the motion is unchanged and
  the current changes by this factor. A speed gain that deviates by a tenth therefore appears as another scale
  of the current, another inertia and another friction. A deviation of one parameter is more probable than
  simultaneous deviations of a sensor and the inertia, or of two sensors.
- Shorts of all phases by a small share reduce torque constant and resistance by this share, and the
  inductance by twice as much. They compensate for a wrong torque constant, but then the inductance
  contradicts them: the residual is regressed on the derivative with respect to the inductance (a score test,
  Rao 1948). Which parameter of the motor deviates is not identifiable: all are estimated, and the intervals
  of the shorts are correspondingly wide.
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

COMPENSATING, OF_TIME_AXIS = (INERTIA, "current_scale", "voltage_scale"), ("position_scale", "speed_scale")
"""Nuisances of which two together indicate a speed gain; and nuisances that indicate a wrong time axis."""


@dataclass(frozen=True)
class PossibleError:
    """Parameters of the description that are estimated together.

    `certain`: whether a deviation is certain. `instead_of`: nuisances that the parameters replace; the
    parameters are kept only if none of these is selected with them.
    """

    parameters: tuple[str, ...]
    certain: bool = False
    instead_of: tuple[str, ...] = ()


def possible_errors(result: SearchResult, names: Sequence[str], seed: int) -> list[PossibleError]:
    """Return the parameters that may deviate although the residual of `result` is expected.

    `names` are the nuisances that were selected for it. Parameters that the actuator does not have, or that
    are calibrated or free already, are omitted. So is the motor if a phase is healthy and no inertia or scale
    was selected: then nothing has compensated for a torque constant.
    """
    actuator, not_described = result.objective.problem.actuator, not_as_described(result.objective)

    def possible(parameters: tuple[str, ...]) -> bool:
        described = all(described_parts(actuator, name) is not None for name in parameters)
        return described and not set(parameters) & set(not_described)

    if set(names) & set(OF_TIME_AXIS):
        return []
    errors = []
    if len(set(names) & set(COMPENSATING)) > 1 and possible(SPEED_LOOP):
        errors.append(PossibleError(SPEED_LOOP, instead_of=COMPENSATING))
    if possible(MOTOR) and (set(names) & set(COMPENSATING) or _all_shorted(result)):
        score = inductance_score(result, seed)
        if score > DESCRIPTION_ERRORS.likely:
            errors.append(PossibleError(MOTOR, score > DESCRIPTION_ERRORS.certain))
    return errors


def not_as_described(objective: MapObjective) -> tuple[str, ...]:
    """Return the parameters that do not rest on the description alone: free and calibrated parameters."""
    baseline = objective.problem.actuator.baseline
    return (*objective.space.nuisances.parameters, *(baseline.names if baseline else ()))


def _all_shorted(result: SearchResult) -> bool:
    """Return whether the estimate has a short in all phases."""
    faults = result.objective.space.faults(result.point)
    return all(faults[NAMES.index(name)] > VERDICT.healthy_margin for name in SHORTS)


def inductance_score(result: SearchResult, seed: int) -> float:
    """Return the deviation of the inductance from its description, in standard errors, by a score test.

    0 if the deviation is below `DESCRIPTION_ERRORS.least`.
    """
    objective = result.objective
    jacobians = jacobians_of(result, stream(seed, "Jacobians of the description"))
    extended = objective_with(objective, (INDUCTANCE,))
    point = extended.space.carried_over(result.point, objective.space)
    points = np.tile(point, (2, 1))
    points[:, -1] = -DESCRIPTION_ERRORS.step, DESCRIPTION_ERRORS.step
    low, high = extended.outputs(points)[:, : objective.channel_rows]
    derivative = (high - low) / (2 * DESCRIPTION_ERRORS.step)
    size, error = size_of_one(result, jacobians, derivative)
    return abs(size) / error if abs(size) > DESCRIPTION_ERRORS.least else 0.0


def with_free(searched: SearchResult, parameters: tuple[str, ...], settings: SearchSettings) -> SearchResult:
    """Return the estimate with `parameters` of the description free, from the estimate `searched` without."""
    child = settings.child("error of the description", *parameters)
    objective = objective_with(searched.objective, parameters)
    return Fit.of(searched, objective, parameters[0], child).corrected(child)


def suspected_parameters(result: SearchResult) -> tuple[str, ...]:
    """Return the names, as quantities of `result`, of parameters that were estimated without a request."""
    actuator, parameters = result.objective.problem.actuator, result.objective.space.nuisances.parameters
    requested = ParameterVariation.of_unit(actuator).parameters
    suspects = (*SPEED_CONTROL, *MOTOR, ROTOR_ZERO, *CURRENT_CONTROL)
    return tuple(BASELINE + name for name in suspects if name in parameters and name not in requested)


def objective_with(objective: MapObjective, parameters: tuple[str, ...]) -> MapObjective:
    """Return the objective with parameters of its actuator free."""
    actuator = objective.problem.actuator
    priors = {name: DESCRIPTION_ERRORS.prior_of(name) for name in parameters}
    return with_open(objective, actuator, ParameterVariation.free(actuator, parameters).known_to(priors))
