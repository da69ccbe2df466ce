"""A healthy unit's parameters from one recording, the nuisances of the day estimated with them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import lumped_parameters
from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.discrepancy import has_reference
from emaphm.estimation.levenberg_marquardt import LeastSquaresResult, LeastSquaresSettings, least_squares
from emaphm.estimation.nuisances import MAGNETS, MAGNETS_DEVIATION, NuisanceSet
from emaphm.estimation.objective import MapObjective, healthy_objective
from emaphm.estimation.parameter_variation import START_FACTOR, WIDEST_FACTOR, ParameterVariation, sizes
from emaphm.estimation.problem import Problem, has_signal
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import jacobians_at, local_covariance
from emaphm.optimizers import space_filling
from emaphm.progress import Progress, subprogress
from emaphm.random_streams import child_seed, stream
from emaphm.recording import Recording

DESCENT = LeastSquaresSettings(step=2e-3, iterations=20, least_gain=1e-6)
"""Fine steps to a flat end: parameters of a healthy unit have no false minima near."""


@dataclass(frozen=True)
class UnitSearchSettings:
    """How a healthy unit's parameters are searched; `examples/emps` shows the result on a real machine.

    The best `refined_starts` of `starts` points within a factor 3 of the description are refined. Costs
    within the factor `equal_costs` count as equal, as kinks alone make them vary by some percent; of these
    the point nearest to the description is taken. Then the channels are weighted by their residuals, in
    `reweightings` further descents.
    """

    starts: int = 15
    refined_starts: int = 3
    equal_costs: float = 1.05
    reweightings: int = 3
    descent: LeastSquaresSettings = DESCENT


SEARCH = UnitSearchSettings()

SAME_PARAMETER = {"load": "offset", "hinge": "hinge", "inertia": "inertia", "supply": "supply"}
"""The parameter that a nuisance cannot be separated from in one recording."""

TORQUES = ("inertia", "viscous", "coulomb", "offset", "hinge")
"""What the motor's torque has to overcome where no load is recorded: known in proportion to it only."""


@dataclass(frozen=True, eq=False)
class UnitEstimate:
    """A healthy unit's parameters and nuisances: `point` (d,) of the objective's space, `covariance` (d, d).

    The last coordinates are those of the parameters that were fitted, as in `ParameterVariation.free`.
    """

    objective: MapObjective
    point: Array
    covariance: Array

    def of(self, free: tuple[str, ...]) -> tuple[Array, Array]:
        """Return the deviations of all `free` parameters (p,) and their covariance (p, p).

        The torque constant was not fitted where the recording has information only on ratios to it: then that
        common scale is unknown. Where the temperature was unknown, the constant at nominal temperature is
        known no better than the magnets' temperature coefficient allows.
        """
        first = self._first
        fitted, _ = self._columns(free)
        chosen = np.eye(len(free))[:, fitted]
        scale = math.log(WIDEST_FACTOR) * self._scale(free)
        covariance = chosen @ self.covariance[first:, first:] @ chosen.T + np.outer(scale, scale)
        nuisances = self.objective.space.nuisances
        if "temperature" in nuisances.quantities and "torque_constant" in nuisances.parameters:
            heat = nuisances.prior_deviations[nuisances.quantities.index("temperature")]
            i = free.index("torque_constant")
            covariance[i, i] += (MAGNETS_DEVIATION * MAGNETS * heat) ** 2
        return chosen @ self.point[first:], covariance

    def nuisances_given(self, free: tuple[str, ...], parameters: Array) -> dict[str, float]:
        """Return the nuisances of the recording by name, conditional on the `free` parameters (p,)."""
        first = self._first
        fitted, held = self._columns(free)
        known = (parameters - self._scale(free) * sum(parameters[held]))[fitted]
        shift = np.linalg.solve(self.covariance[first:, first:], known - self.point[first:])
        others = self.point[:first] + self.covariance[:first, first:] @ shift
        space = self.objective.space
        point = space.project(np.concatenate([others, known]))
        values = space.nuisance_values(point[np.newaxis])
        return {name: float(values[name][0]) for name in space.nuisances.names[:first]}

    @property
    def _first(self) -> int:
        return self.point.size - len(self.objective.space.nuisances.parameters)

    def _columns(self, free: tuple[str, ...]) -> tuple[list[int], list[int]]:
        """Return the indices of the parameters that were fitted, and of the one that was held, if any."""
        used = self.objective.space.nuisances.parameters
        return [free.index(name) for name in used], [i for i, name in enumerate(free) if name not in used]

    def _scale(self, free: tuple[str, ...]) -> Array:
        """Return the effect on the deviations (p,) of a common factor of all torques, by its logarithm."""
        _, held = self._columns(free)
        if not held:
            return np.zeros(len(free))
        actuator = self.objective.problem.actuator
        size = sizes(actuator, ("offset",))[0]
        of_each = dict.fromkeys((*TORQUES, "static", "torque_constant"), 1.0)
        values = self.objective.lumped_parameters(self.point[np.newaxis])
        if "offset" in values:
            of_each["offset"] = float(values["offset"][0]) / size
        return np.array([of_each.get(name, 0.0) for name in free])


def unit_objective(
    recording: Recording,
    actuator: Actuator,
    unit: ParameterVariation,
    nuisances: Sequence[str] | None,
    workers: int | None,
) -> MapObjective:
    """Return the objective of a healthy unit's parameters and nuisances, by every channel of a recording.

    A nuisance that cannot be separated from a free parameter is left out, and so is the torque constant
    where the recording has information only on ratios to it.

    Raises
    ------
    MethodError
        Such a nuisance is asked for; or one is unknown, or needs what the actuator lacks.
    """
    for name in nuisances or ():
        if SAME_PARAMETER.get(name) in unit.parameters:
            raise MethodError(
                f"nuisance '{name}' cannot be separated from parameter '{SAME_PARAMETER[name]}'; leave "
                f"one out"
            )
    problem = Problem.of(recording, actuator, workers=workers, channels=None)
    possible = NuisanceSet.of(actuator, nuisances, tuple(problem.measured)).chosen
    kept = tuple(name for name in possible if SAME_PARAMETER.get(name) not in unit.parameters)
    if _only_ratios(recording, actuator, unit.parameters):
        others = tuple(name for name in unit.parameters if name != "torque_constant")
        unit = ParameterVariation.free(actuator, others)
    return healthy_objective(problem, kept, unit)


def _only_ratios(recording: Recording, actuator: Actuator, free: tuple[str, ...]) -> bool:
    """Return whether a recording has information only on ratios of torques to the torque constant.

    A voltage would show the constant by the speed, a recorded load by the current that holds it.
    """
    acting = {name for name, value in lumped_parameters(actuator, TORQUES).items() if value}
    by_voltage = actuator.electrical is not None and has_signal(recording, "voltage_V")
    return "torque_constant" in free and acting <= set(free) and not by_voltage and "load_Nm" not in recording


def estimate_unit(
    objective: MapObjective, max_corrections: int, seed: int, on_progress: Progress | None = None
) -> UnitEstimate:
    """Return the parameters and nuisances that minimise a healthy unit's objective, with their covariance.

    `max_corrections` bounds the corrections of the model's bias by the reference model.
    """
    point = _search(objective, seed, subprogress(on_progress, 0.0, 1 / 3))
    for _ in range(SEARCH.reweightings):
        objective = objective.reweighted(objective.residual(point))
        point = _descend(objective, point[np.newaxis]).best
    result = SearchResult.at(objective, point)
    if max_corrections > 0 and has_reference(objective.problem):
        correcting = subprogress(on_progress, 1 / 3, 1.0)
        result = correct_bias(objective, point[np.newaxis], max_corrections, seed, correcting)
    jacobians = jacobians_at(result.objective, result.point, stream(seed, "Jacobians of the covariance"))
    residual = result.residual[: result.objective.channel_rows]
    # Descents stop short of the prior where a recording has little information; a step by all Jacobians
    # does not.
    local = local_covariance(result.objective, result.point, residual, jacobians)
    if on_progress is not None:
        on_progress(1.0)
    end = result.objective.space.project(result.point + local.step)
    return UnitEstimate(result.objective, end, local.covariance)


def _search(objective: MapObjective, seed: int, on_progress: Progress | None) -> Array:
    """Return the refined best (d,) of the description's values and of starts around them."""
    free = len(objective.space.nuisances.parameters)
    around = np.full(free, math.log(START_FACTOR))
    starts = np.zeros((1 + SEARCH.starts, objective.space.dimensions))
    starts[1:, -free:] = space_filling(SEARCH.starts, -around, around, child_seed(seed, "starts"))
    costs = np.mean((objective.target - objective.outputs(starts)) ** 2, axis=1)
    best = np.unique([0, *np.argsort(costs, kind="stable")[: SEARCH.refined_starts]])
    found = _descend(objective, starts[best], on_progress)
    # What the recording does not determine is most likely as it is described.
    equal = found.points[found.costs <= SEARCH.equal_costs * found.costs.min()]
    return np.asarray(equal[np.argmin(np.linalg.norm(equal[:, -free:], axis=1))])


def _descend(
    objective: MapObjective, starts: Array, on_progress: Progress | None = None
) -> LeastSquaresResult:
    """Return where least squares lead from `starts` (m, d)."""
    iterations = SEARCH.descent.iterations
    report = None if on_progress is None else lambda i: on_progress(i / iterations)
    return least_squares(objective.outputs, objective.target, starts, objective.space, SEARCH.descent, report)
