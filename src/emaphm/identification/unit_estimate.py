"""What one recording of a healthy unit tells of its parameters, the unknowns of the day set apart."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.errors import MethodError
from emaphm.identification.correction import correct, has_reference
from emaphm.identification.deviations import START_FACTOR, Deviations
from emaphm.identification.fit import Fit
from emaphm.identification.methods import method_named
from emaphm.identification.nuisance import NuisanceSet
from emaphm.identification.optimizers import space_filling
from emaphm.identification.refinement import refine, scattered
from emaphm.identification.search import fit_of
from emaphm.identification.space import FaultSpace
from emaphm.identification.uncertainty import knowledge
from emaphm.recording import Recording
from emaphm.simulation import AVERAGED

Array = NDArray[np.float64]
Progress = Callable[[float], None]

STARTS, REFINED_STARTS = 15, 3
STEP, ITERATIONS, TOLERANCE = 2e-3, 20, 1e-6

ALIKE = 1.05
"""Costs within this factor are as good as each other: kinks alone make them vary by some percent."""

REWEIGHTINGS = 3
"""Descents with the channels weighted by what the one before left of them."""

DERIVATIVE_STEP, DERIVATIVES = 1e-2, 8
"""Step of the differences that standard errors are told from, and how often they are taken."""

ONE_AND_THE_SAME = {"load": "offset", "hinge": "hinge", "inertia": "inertia", "supply": "supply"}
"""The parameter that a nuisance cannot be told from in one recording."""


@dataclass(frozen=True, eq=False)
class UnitEstimate:
    """Where the fit of a healthy unit ended: its `point` (d,), of `covariance` (d, d).

    The last `free` coordinates are the parameters', as in `Deviations.free`.
    """

    fit: Fit
    point: Array
    covariance: Array
    free: int
    evaluations: int

    @property
    def parameters(self) -> Array:
        """The deviations of the free parameters from the description, (p,)."""
        return self.point[-self.free :]

    @property
    def parameter_covariance(self) -> Array:
        """The covariance of the parameters, (p, p), whatever else was unknown of the recording."""
        return self.covariance[-self.free :, -self.free :]

    def nuisances_given(self, parameters: Array) -> dict[str, float]:
        """Return the nuisances of the recording by name, the `parameters` (p,) being known."""
        others = slice(0, self.point.size - self.free)
        shift = np.linalg.solve(self.parameter_covariance, parameters - self.parameters)
        known = np.concatenate(
            [self.point[others] + self.covariance[others, -self.free :] @ shift, parameters]
        )
        values = self.fit.space.nuisance_values(self.fit.space.project(known)[np.newaxis])
        return {name: float(values[name][0]) for name in self.fit.space.nuisances.names[others]}


def healthy_fit(
    recording: Recording,
    actuator: Actuator,
    unit: Deviations,
    nuisances: Sequence[str] | None,
    workers: int | None,
) -> Fit:
    """Return the fit of a healthy unit's parameters, and of the nuisances, to every channel.

    A nuisance that is one and the same with a free parameter is left out.

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
    space = FaultSpace.healthy(NuisanceSet.of(actuator, known, recording.names, unit))
    return Fit.of(fit.problem, space)


def estimate_unit(
    fit: Fit, unit: Deviations, turns: int, seed: int, on_progress: Progress | None = None
) -> UnitEstimate:
    """Return what the recording of `fit` tells of the `unit`.

    `turns` bounds the corrections of the model's bias by the reference model.
    """
    tell = on_progress or (lambda _: None)
    point, evaluations = _search(fit, unit.priors.size, seed, lambda fraction: tell(fraction / 3))
    for _ in range(REWEIGHTINGS):
        fit = fit.reweighted(fit.target - fit.outputs(point[np.newaxis])[0])
        found = _descend(fit, point[np.newaxis])
        point, evaluations = found[0][0], evaluations + found[2] + 1
    correction: Array | float = 0.0
    left: Array | float = 0.0
    if turns > 0 and has_reference(fit.problem):
        corrected = correct(fit, point, turns, lambda fraction: tell((1 + 2 * fraction) / 3))
        fit, point, correction = corrected.fit, corrected.point, corrected.correction
        left = corrected.discrepancy - corrected.correction
        evaluations += corrected.evaluations
    residual = fit.target - fit.outputs(point[np.newaxis])[0] - correction - left
    rows, channels = fit.recorded_rows, len(fit.problem.channels)
    derivatives, spent = scattered(
        lambda points: fit.outputs(points)[:, :rows], point, fit.space, DERIVATIVE_STEP, DERIVATIVES, seed
    )
    unknown = fit.space.nuisances
    spread = knowledge(derivatives, residual[:rows], unknown.priors, channels).covariance
    tell(1.0)
    return UnitEstimate(fit, point, spread, unit.priors.size, evaluations + spent + 1)


def _search(fit: Fit, free: int, seed: int, on_progress: Progress) -> tuple[Array, int]:
    """Return the refined best of the description's values and of starts spread around them, and the runs."""
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
