"""How well a manoeuvre will identify each fault, told before the test from Fisher's information."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from emaphm import rig
from emaphm.actuator import NAMES, Actuator, Chirp
from emaphm.actuator.faults import HEALTHY
from emaphm.errors import MethodError, SignalError, nearest
from emaphm.identification.correction import PRIOR_DEVIATION, has_reference
from emaphm.identification.diagnose import DERIVATIVE_STEP, RESOLUTION
from emaphm.identification.fit import Fit
from emaphm.identification.nuisance import RANGE, NuisanceSet
from emaphm.identification.optimizers.space_filling import space_filling
from emaphm.identification.problem import Problem
from emaphm.identification.refinement import scattered
from emaphm.identification.space import FaultSpace
from emaphm.identification.uncertainty import knowledge
from emaphm.identification.verdict import WIDEST_HALF_INTERVAL, Z95, estimates
from emaphm.recording import Recording, full_scales
from emaphm.simulation import REFERENCE, Initial

Array = NDArray[np.float64]

CHANNELS = {
    "current": "current_A",
    "voltage": "voltage_V",
    "position": "position_rad",
    "speed": "speed_rad_s",
}
"""What may be recorded, by the name that a user gives it."""

CONVERTER_BITS = 12
"""Resolution taken for the channels other than the current."""

VECTORS = 4
"""Faults that an expectation is told about: one healthy vector, and others that fill the space."""

LEAST_MOTION = 0.01
"""Share of the command's range that the position must cover for the manoeuvre to move the actuator."""


@dataclass(frozen=True, eq=False)
class Conditions:
    """Under which a test is made: `channels` by schema name, current first; `noise` of it [A rms]."""

    actuator: Actuator
    channels: tuple[str, ...]
    noise: float
    sample_rate: float
    seed: int

    @classmethod
    def of(
        cls, actuator: Actuator, channels: Sequence[str], noise: float, sample_rate: float, seed: int
    ) -> Self:
        """Return the conditions, `channels` being names of `CHANNELS`.

        Raises
        ------
        MethodError, SignalError
            A channel is unknown, impossible for the actuator, or the current missing; the noise or rate
            is no positive number.
        """
        for name in channels:
            if name not in CHANNELS:
                raise MethodError(f"unknown channel '{name}'{nearest(name, CHANNELS)}")
        if "current" not in channels:
            raise MethodError("the current is what faults are told from; put current among the channels")
        if "voltage" in channels and actuator.electrical is None:
            raise MethodError(
                f"channel 'voltage' needs an [electrical] section, which actuator '{actuator.name}' lacks"
            )
        if not 0 < noise < np.inf:
            raise SignalError(f"noise of {noise:g} A is no sensor's rms; give more than 0")
        if not 0 < sample_rate < np.inf:
            raise SignalError(f"sample rate of {sample_rate:g} Hz is impossible; give more than 0")
        if seed < 0:
            raise SignalError(f"seed {seed} is negative; give 0 or more")
        kept = tuple(column for name, column in CHANNELS.items() if name in channels)
        return cls(actuator, kept, noise, sample_rate, seed)

    def fit(self, command: Chirp) -> Fit:
        """Return what a diagnosis would fit to a recording of `command`."""
        recording = rig.simulate(
            self.actuator,
            command,
            model="averaged",
            duration=command.duration,
            sample_rate=self.sample_rate,
            sampling=self.actuator.channels.sampling,
        )
        if np.ptp(recording["position_rad"]) < LEAST_MOTION * np.ptp(recording["command_rad"]):
            raise SignalError("the manoeuvre does not move the actuator; allow more amplitude or time")
        kept = {name: recording[name] for name in ("time_s", "command_rad", *self.channels)}
        shown = Recording(kept, recording.sampling, recording.source)
        problem = Problem.of(shown, self.actuator, workers=1, channels=self.channels)
        problem = replace(problem, start=Initial()).weighted(self.noises(shown))
        space = FaultSpace.of(self.actuator, NuisanceSet.of(self.actuator, None, self.channels))
        return Fit.of(problem, space).against(self.noise)

    def noises(self, recording: Recording) -> Array:
        """Return the rms of each channel's noise (channels,): a converter's rounding but for the current.

        Where the description tells no full scale, it is twice the channel's own peak.
        """
        scales = full_scales(self.actuator)
        result = [self.noise]
        for name in self.channels[1:]:
            scale = scales.get(name, 2 * float(np.max(np.abs(recording[name]))))
            result.append(2 * scale / 2**CONVERTER_BITS / 12**0.5)
        return np.array(result)

    def vectors(self, space: FaultSpace) -> Array:
        """Return representative points (n, d) of `space`, the healthy one first, the nuisances at 0."""
        unit = space_filling(VECTORS - 1, np.zeros(len(NAMES)), np.ones(len(NAMES)), self.seed)
        healthy = space.points(HEALTHY.vector)
        return np.concatenate([healthy[np.newaxis], space.points(unit)])


@dataclass(frozen=True, eq=False)
class Expected:
    """Expected half-widths of the 95 % intervals by component, the median over representative faults.

    `half_widths` lacks what the actuator cannot show. That of the phase is given its radius: it is the
    median over the vectors that have an eccentricity.
    """

    half_widths: dict[str, float]
    objective: float

    def told(self, name: str) -> bool:
        """Return whether a diagnosis of the manoeuvre is expected to tell component `name`."""
        return self.half_widths.get(name, np.inf) <= WIDEST_HALF_INTERVAL


def expected(conditions: Conditions, command: Chirp, *, ripple: bool = True) -> Expected:
    """Return how well a recording of `command` will tell each fault.

    Parameters
    ----------
    ripple
        Whether the residual holds what the reference model's ripple leaves beside noise; slower.
    """
    fit = conditions.fit(command)
    widths, objectives = [], []
    for point in conditions.vectors(fit.space):
        covariance = _covariance(conditions, fit, point, ripple=ripple)
        found = estimates(fit.space, point, covariance)
        widths.append(
            {name: Z95 * e.standard_error for name, e in found.items() if name not in fit.space.fixed}
        )
        faults = len(fit.space.columns)
        objectives.append(float(np.mean(np.log(Z95 * np.sqrt(np.diag(covariance)[:faults])))))
    # The first vector is healthy: it has no direction.
    medians = {
        name: float(np.median([w[name] for w in (widths[1:] if name == "eccentricity_phase" else widths)]))
        for name in widths[0]
    }
    return Expected(medians, float(np.mean(objectives)))


def _covariance(conditions: Conditions, fit: Fit, point: Array, *, ripple: bool) -> Array:
    """Return the covariance (d, d) that a diagnosis would give at `point` (d,)."""
    space, rows, faults = fit.space, fit.recorded_rows, len(fit.space.columns)
    rng = np.random.default_rng(conditions.seed)
    residual = rng.normal(0.0, conditions.noise, rows)
    if ripple and has_reference(fit.problem):
        # A diagnosis corrects what both points have in common; what differs between neighbours stays.
        reference = fit.problem.by(REFERENCE)
        reference = replace(reference, start=fit.problem.start)
        beside = space.project(point + RESOLUTION * rng.normal(size=point.size))
        here, there = (fit.discrepancy(reference, p)[:rows] for p in (point, beside))
        residual = residual + here - there
    deviations = np.where(np.arange(space.dimensions) < faults, PRIOR_DEVIATION, 1 / RANGE)
    derivatives, _ = scattered(
        lambda points: fit.outputs(points)[:, :rows], point, space, DERIVATIVE_STEP, 4, conditions.seed
    )
    known = knowledge(derivatives, residual, deviations, len(fit.problem.channels))
    return np.asarray(known.covariance + RESOLUTION**2 * np.eye(space.dimensions))
