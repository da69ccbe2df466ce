"""What one recording of a healthy unit tells of its parameters, the unknowns of the day set apart."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import totals
from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.estimation.bias_correction import correct, has_reference
from emaphm.estimation.levenberg_marquardt import refine
from emaphm.estimation.local_covariance import neighbourhood, slopes
from emaphm.estimation.methods import method_named
from emaphm.estimation.nuisances import MAGNETS, MAGNETS_SPREAD, NuisanceSet
from emaphm.estimation.objective import Fit
from emaphm.estimation.parameter_space import FaultSpace
from emaphm.estimation.parameter_variation import START_FACTOR, WIDEST_FACTOR, Deviations, sizes
from emaphm.estimation.search import fit_of, tells
from emaphm.optimizers import space_filling
from emaphm.progress import Progress
from emaphm.recording import Recording
from emaphm.simulation import AVERAGED

STARTS, REFINED_STARTS = 15, 3
STEP, ITERATIONS, TOLERANCE = 2e-3, 20, 1e-6

ALIKE = 1.05
"""Costs within this factor are as good as each other: kinks alone make them vary by some percent."""

REWEIGHTINGS = 3
"""Descents with the channels weighted by what the one before left of them."""

ONE_AND_THE_SAME = {"load": "offset", "hinge": "hinge", "inertia": "inertia", "supply": "supply"}
"""The parameter that a nuisance cannot be told from in one recording."""


MOMENTS = ("inertia", "viscous", "coulomb", "offset", "hinge")
"""What the motor's torque has to overcome, if its load is not recorded: all known in proportion to it."""


@dataclass(frozen=True, eq=False)
class UnitEstimate:
    """Where the fit of a healthy unit ended: its `point` (d,), of `covariance` (d, d).

    The last coordinates are those of the parameters that were fitted, as in `Deviations.free`.
    """

    fit: Fit
    point: Array
    covariance: Array
    evaluations: int

    def of(self, free: tuple[str, ...]) -> tuple[Array, Array]:
        """Return the deviations of all `free` parameters (p,) and their covariance (p, p).

        The torque constant was not fitted where the recording tells moments in proportion to it alone:
        then nothing is known of that common scale. Where heat was unknown, the recording tells the constant
        at nominal temperature no better than what magnets lose by heat is known.
        """
        first = self._first
        fitted, _ = self._columns(free)
        chosen = np.eye(len(free))[:, fitted]
        scale = math.log(WIDEST_FACTOR) * self._scale(free)
        spread = chosen @ self.covariance[first:, first:] @ chosen.T + np.outer(scale, scale)
        unknown = self.fit.space.nuisances
        if "temperature" in unknown.quantities and "torque_constant" in unknown.parameters:
            heat = unknown.deviations[unknown.quantities.index("temperature")]
            i = free.index("torque_constant")
            spread[i, i] += (MAGNETS_SPREAD * MAGNETS * heat) ** 2
        return chosen @ self.point[first:], spread

    def nuisances_given(self, free: tuple[str, ...], parameters: Array) -> dict[str, float]:
        """Return the nuisances of the recording by name, the `free` parameters (p,) being known."""
        first = self._first
        fitted, held = self._columns(free)
        known = (parameters - self._scale(free) * sum(parameters[held]))[fitted]
        shift = np.linalg.solve(self.covariance[first:, first:], known - self.point[first:])
        others = self.point[:first] + self.covariance[:first, first:] @ shift
        point = self.fit.space.project(np.concatenate([others, known]))
        values = self.fit.space.nuisance_values(point[np.newaxis])
        return {name: float(values[name][0]) for name in self.fit.space.nuisances.names[:first]}

    @property
    def _first(self) -> int:
        return self.point.size - len(self.fit.space.nuisances.parameters)

    def _columns(self, free: tuple[str, ...]) -> tuple[list[int], list[int]]:
        """Return the indices of the parameters that were fitted, and of the one that was held, if any."""
        used = self.fit.space.nuisances.parameters
        return [free.index(name) for name in used], [i for i, name in enumerate(free) if name not in used]

    def _scale(self, free: tuple[str, ...]) -> Array:
        """Return what a common factor of all moments makes of the deviations, (p,), by its logarithm."""
        _, held = self._columns(free)
        if not held:
            return np.zeros(len(free))
        actuator = self.fit.problem.actuator
        size = sizes(actuator, ("offset",))[0]
        of_each = dict.fromkeys((*MOMENTS, "static", "torque_constant"), 1.0)
        values = self.fit.totals(self.point[np.newaxis])
        if "offset" in values:
            of_each["offset"] = float(values["offset"][0]) / size
        return np.array([of_each.get(name, 0.0) for name in free])


def _tells_no_scale(recording: Recording, actuator: Actuator, free: tuple[str, ...]) -> bool:
    """Return whether a recording tells every moment in proportion to the torque constant alone.

    A voltage would tell the constant from the speed, a recorded load from what it takes to hold it.
    """
    acting = {name for name, value in totals(actuator, MOMENTS).items() if value}
    told = actuator.electrical is not None and tells(recording, "voltage_V")
    return "torque_constant" in free and acting <= set(free) and not told and "load_Nm" not in recording


def healthy_fit(
    recording: Recording,
    actuator: Actuator,
    unit: Deviations,
    nuisances: Sequence[str] | None,
    workers: int | None,
) -> Fit:
    """Return the fit of a healthy unit's parameters, and of the nuisances, to every channel.

    A nuisance that is one and the same with a free parameter is left out, and so is the torque constant
    where the recording cannot tell it.

    Raises
    ------
    MethodError
        Such a nuisance is asked for; or one is unknown, or needs what the actuator lacks.
    """
    for name in nuisances or ():
        if ONE_AND_THE_SAME.get(name) in unit.parameters:
            raise MethodError(
                f"nuisance '{name}' cannot be told from parameter '{ONE_AND_THE_SAME[name]}'; leave one out"
            )
    wanted = actuator.nuisances.estimated if nuisances is None else tuple(nuisances)
    kept = tuple(name for name in wanted if ONE_AND_THE_SAME.get(name) not in unit.parameters)
    fit = fit_of(recording, actuator, method_named("hybrid"), AVERAGED, nuisances, workers)
    # Where the description is the source, a nuisance that it lacks the means for is left out silently.
    known = tuple(name for name in kept if name in fit.space.nuisances.quantities)
    if _tells_no_scale(recording, actuator, unit.parameters):
        unit = Deviations.free(actuator, tuple(n for n in unit.parameters if n != "torque_constant"))
    space = FaultSpace.healthy(NuisanceSet.of(actuator, known, recording.names, unit))
    return Fit.of(fit.problem, space)


def estimate_unit(fit: Fit, turns: int, seed: int, on_progress: Progress | None = None) -> UnitEstimate:
    """Return what the recording of a healthy unit's `fit` tells.

    `turns` bounds the corrections of the model's bias by the reference model.
    """
    tell = on_progress or (lambda _: None)
    point, evaluations = _search(fit, seed, lambda fraction: tell(fraction / 3))
    for _ in range(REWEIGHTINGS):
        fit = fit.reweighted(fit.target - fit.outputs(point[np.newaxis])[0])
        found = _descend(fit, point[np.newaxis])
        point, evaluations = found[0][0], evaluations + found[2] + 1
    correction: Array | float = 0.0
    left: Array | float = 0.0
    if turns > 0 and has_reference(fit.problem):
        corrected = correct(fit, point[np.newaxis], turns, lambda fraction: tell((1 + 2 * fraction) / 3))
        fit, point, correction = corrected.fit, corrected.point, corrected.correction
        left = corrected.discrepancy - corrected.correction
        evaluations += corrected.evaluations
    residual = fit.target - fit.outputs(point[np.newaxis])[0] - correction - left
    derivatives, spent = slopes(fit, point, seed)
    # Descents stop short of the prior where the recording tells little; one step by all derivatives does not.
    near = neighbourhood(fit, point, residual[: fit.recorded_rows], derivatives)
    tell(1.0)
    return UnitEstimate(fit, fit.space.project(point + near.step), near.covariance, evaluations + spent + 1)


def _search(fit: Fit, seed: int, on_progress: Progress) -> tuple[Array, int]:
    """Return the refined best of the description's values and of starts spread around them, and the runs."""
    free = len(fit.space.nuisances.parameters)
    around = np.full(free, math.log(START_FACTOR))
    starts = np.zeros((1 + STARTS, fit.space.dimensions))
    starts[1:, -free:] = space_filling(STARTS, -around, around, seed)
    misfits = np.mean((fit.target - fit.outputs(starts)) ** 2, axis=1)
    best = np.unique([0, *np.argsort(misfits, kind="stable")[:REFINED_STARTS]])
    points, costs, evaluations = _descend(fit, starts[best], on_progress)
    # What the recording does not tell is nowhere as likely as where it is described.
    alike = points[costs <= ALIKE * costs.min()]
    return alike[np.argmin(np.linalg.norm(alike[:, -free:], axis=1))], evaluations + len(starts)


def _descend(fit: Fit, starts: Array, on_progress: Progress | None = None) -> tuple[Array, Array, int]:
    """Return where least squares lead from `starts` (m, d), the costs there, and the runs spent."""
    found = refine(
        fit.outputs,
        fit.target,
        starts,
        fit.space,
        step=STEP,
        iterations=ITERATIONS,
        tolerance=TOLERANCE,
        on_iteration=(lambda i: on_progress(i / ITERATIONS)) if on_progress else None,
    )
    return found.points, found.costs, found.evaluations
