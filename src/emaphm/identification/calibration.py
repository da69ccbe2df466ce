"""Calibrating a healthy unit: its physical parameters, by the same least squares on the same model."""

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.actuator.faults import HEALTHY
from emaphm.actuator.quantity import unit_for
from emaphm.actuator.totals import TOTALS, totals, with_totals
from emaphm.errors import MethodError
from emaphm.identification.optimizers import space_filling
from emaphm.identification.problem import Problem
from emaphm.identification.refinement import Refined, refine, sensitivity
from emaphm.identification.replay import Replay, replay
from emaphm.identification.space import Box
from emaphm.identification.uncertainty import knowledge
from emaphm.identification.wording import format_table
from emaphm.recording import Recording, check_plausible
from emaphm.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

WIDEST_FACTOR = 30.0
"""A parameter is sought within this factor of the description's value, either way."""

START_FACTOR = 3.0
"""The starts are spread within this factor."""

STARTS, REFINED_STARTS = 15, 3
STEP = 2e-3

LEAST_KNOWN = 0.5
"""A parameter with a larger relative standard error is called not identifiable."""


@dataclass(frozen=True)
class Parameter:
    """One calibrated parameter with its standard error, both in `unit`."""

    value: float
    standard_error: float
    unit: str
    identifiable: bool


@dataclass(frozen=True, eq=False)
class Calibration:
    """Parameters of a healthy unit, the calibrated `actuator`, and how well it replays the recording."""

    parameters: Mapping[str, Parameter]
    actuator: Actuator
    replay: Replay
    evaluations: int
    seconds: float
    seed: int

    @property
    def relative_error(self) -> Mapping[str, float]:
        """The relative error of each channel, as a fraction."""
        return self.replay.relative_error

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm calibrate --json` prints."""
        return {
            "parameters": {
                name: {
                    "value": p.value,
                    "standard_error": p.standard_error,
                    "unit": p.unit,
                    "identifiable": p.identifiable,
                }
                for name, p in self.parameters.items()
            },
            "relative_error": dict(self.relative_error),
            "evaluations": self.evaluations,
            "seconds": round(self.seconds, 3),
            "seed": self.seed,
            "recording": self.replay.recording.source,
            "actuator": self.actuator.name,
            "version": VERSION,
        }

    def to_json(self) -> str:
        """Return the calibration as JSON."""
        return json.dumps(self.to_dict(), indent=2)

    def plot(self) -> "Figure":
        """Draw each channel, measured against calibrated model, with its residual."""
        return self.replay.plot()

    def __str__(self) -> str:
        """Return tables of the parameters and of the relative errors."""
        rows = [
            (
                name,
                f"{p.value:.6g}",
                f"{p.standard_error:.2g}",
                p.unit if p.identifiable else f"{p.unit}  (not identifiable from this recording)",
            )
            for name, p in self.parameters.items()
        ]
        return format_table(("parameter", "value", "std. error", "unit"), rows) + f"\n\n{self.replay}"


def calibrate(
    recording: Recording,
    actuator: Actuator,
    free: Sequence[str],
    *,
    seed: int = 0,
    workers: int | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Calibration:
    """Return the parameters `free` of a healthy unit that explain `recording`, and the calibrated actuator.

    Parameters
    ----------
    actuator
        The description to start from; its values need only be right within a factor of 3 or so.
    free
        Names from `emaphm.actuator.totals.TOTALS`; the others keep their values. Static friction keeps
        its ratio to dynamic friction unless it is free itself.
    seed
        Of the starting points.

    Raises
    ------
    MethodError
        No parameter, or an unknown one, is free; one needs a section that the actuator lacks; or one
        starts at zero, where its size is not known.
    RecordingError
        The recording cannot be meant for this actuator, by orders of magnitude.
    """
    began = time.perf_counter()
    if not free:
        raise MethodError(f"no parameter to calibrate; name some of {', '.join(TOTALS)}")
    check_plausible(recording, actuator)
    problem = Problem.of(recording, actuator, workers=workers)
    scales = _Scales.of(actuator, tuple(dict.fromkeys(free)))

    def simulate(points: Array) -> Array:
        return problem.currents(np.tile(HEALTHY.vector, (len(points), 1)), scales.values(points))

    box = scales.box()
    found = _search(simulate, problem.recorded, box, seed, on_progress)
    point = found.points[found.best]
    residual = problem.recorded - simulate(point[np.newaxis])[0]
    derivatives, spent = sensitivity(simulate, point, box, STEP * np.eye(point.size))
    spread = knowledge(derivatives, residual, np.full(point.size, math.log(WIDEST_FACTOR))).covariance
    values = {name: float(value[0]) for name, value in scales.values(point[np.newaxis]).items()}
    if "static" in values:
        # Below dynamic friction it has no effect, so the search may have left it anywhere there.
        dynamic = values.get("coulomb", actuator.mechanics.dynamic_friction)
        values["static"] = max(values["static"], dynamic)
    calibrated = with_totals(actuator, values, name=f"{actuator.name}, calibrated")
    return Calibration(
        scales.parameters(point, spread, actuator.coordinates),
        calibrated,
        replay(recording, calibrated),
        found.evaluations + spent + 1,
        time.perf_counter() - began,
        seed,
    )


@dataclass(frozen=True, eq=False)
class _Scales:
    """Maps points (n, d) of order 1 to parameters: logarithms for what is positive, linear for the offset."""

    names: tuple[str, ...]
    nominal: Array
    linear: Array

    @classmethod
    def of(cls, actuator: Actuator, names: tuple[str, ...]) -> Self:
        present = totals(actuator, names)
        for name, value in present.items():
            if value <= 0 and name != "offset":
                raise MethodError(
                    f"parameter '{name}' is {value:g} in actuator '{actuator.name}', so its size is unknown; "
                    "give an estimate there to start from"
                )
        # An offset has a sign; it is measured in units of what friction alone takes.
        size = (
            actuator.mechanics.dynamic_friction
            or actuator.controller.current_limit * actuator.motor.torque_constant
        )
        linear = np.array([size if name == "offset" else 0.0 for name in names])
        return cls(names, np.array(list(present.values())), linear)

    def values(self, points: Array) -> dict[str, Array]:
        values = np.where(self.linear > 0, self.nominal + self.linear * points, self.nominal * np.exp(points))
        return dict(zip(self.names, values.T, strict=True))

    def box(self) -> Box:
        widest = np.full(len(self.names), math.log(WIDEST_FACTOR))
        return Box(-widest, widest)

    def parameters(self, point: Array, spread: Array, coordinates: str) -> dict[str, Parameter]:
        result = {}
        for i, (name, values) in enumerate(self.values(point[np.newaxis]).items()):
            value, deviation = float(values[0]), float(np.sqrt(spread[i, i]))
            error = deviation * (self.linear[i] or value)
            unit = unit_for(TOTALS[name], coordinates)
            result[name] = Parameter(value, float(error), unit, identifiable=deviation < LEAST_KNOWN)
        return result


def _search(
    simulate: Callable[[Array], Array],
    recorded: Array,
    box: Box,
    seed: int,
    on_progress: Callable[[float], None] | None,
) -> Refined:
    """Return the refined best of the description's values and of starts spread around them."""
    iterations = 20
    d = box.lower.size
    around = np.full(d, math.log(START_FACTOR))
    starts = np.concatenate([np.zeros((1, d)), space_filling(STARTS, -around, around, seed)])
    misfits = np.mean((recorded - simulate(starts)) ** 2, axis=1)
    best = np.argsort(misfits, kind="stable")[:REFINED_STARTS]
    found = refine(
        simulate,
        recorded,
        starts[best],
        box,
        step=STEP,
        iterations=iterations,
        tolerance=1e-6,
        on_iteration=(lambda i: on_progress(i / iterations)) if on_progress else None,
    )
    return Refined(found.points, found.costs, found.evaluations + len(starts))
