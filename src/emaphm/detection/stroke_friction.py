"""Estimation of friction from the size of the current alone, on strokes in both directions at one load."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.actuator.parameters import FaultScales
from emaphm.arrays import Array
from emaphm.detection.segments import StrokeSegment, strokes_of
from emaphm.detection.settings import DETECTOR
from emaphm.diagnosis.verdict import VERDICT, Estimate, Verdict
from emaphm.errors import RecordingError
from emaphm.recording import Recording

SETTLED = 0.5
"""Last share of a stroke, in which transients have settled and the speed is that of the command."""


@dataclass(frozen=True)
class StrokeCurrent:
    """Parts of the current's size on steady strokes: `friction_A` for friction, `load_A` for the load [A].

    With friction F and load L, both as currents, the size of the current is |F - L| on an up-stroke and
    |F + L| on a down-stroke (a positive load supports the up-stroke). While the load does not drive the
    actuator, |L| < F, half the sum is F and half the difference is L. A current that the drive takes without
    torque is included in `friction_A`: its differences are those of friction, its value is an upper bound.
    """

    friction_A: float
    load_A: float

    @classmethod
    def of(cls, recording: Recording) -> "StrokeCurrent":
        """Return the parts of the current in a recording of one or more cycles at a constant load.

        Raises
        ------
        RecordingError
            There is no current, or the command does not move in both directions.
        """
        if "current_A" not in recording:
            raise RecordingError(
                f"{recording.source}: no current_A, from which friction is estimated; record it"
            )
        size = np.abs(recording["current_A"])
        strokes = strokes_of(recording["command_rad"], DETECTOR)
        currents = [
            [_steady_mean(size, stroke) for stroke in strokes if stroke.stroke == kind]
            for kind in ("up-stroke", "down-stroke")
        ]
        if not all(currents):
            raise RecordingError(
                f"{recording.source}: the command does not move in both directions, so friction cannot be "
                "separated from the load; record an up-stroke and a down-stroke"
            )
        up, down = (float(np.mean(steady)) for steady in currents)
        return cls((up + down) / 2, (down - up) / 2)


def current_per_load(currents: Sequence[StrokeCurrent], loads: Sequence[float]) -> float:
    """Return the current per unit of load [A/N or A/(N·m)], by least squares through 0; NaN if all are 0."""
    known = np.asarray(loads, dtype=np.float64)
    measured = np.array([current.load_A for current in currents])
    return float(measured @ known / (known @ known)) if np.any(known) else float("nan")


@dataclass(frozen=True)
class HealthyFriction:
    """Friction current of healthy runs at one load: mean and standard deviation [A], and number of runs.

    `cycle_deviation_A` is the standard deviation of single cycles.
    """

    mean_A: float
    deviation_A: float
    cycle_deviation_A: float
    runs: int

    @classmethod
    def learn(cls, runs: Sequence[Sequence[StrokeCurrent]]) -> "HealthyFriction":
        """Return the mean and the scatter of healthy `runs`, each a sequence of cycles.

        Raises
        ------
        RecordingError
            There are fewer than three runs.
        """
        if len(runs) < DETECTOR.fewest_runs_of_load:
            raise RecordingError(
                f"{len(runs)} healthy runs at this load, at least {DETECTOR.fewest_runs_of_load} are needed "
                "to estimate the scatter of friction; record more"
            )
        by_run = [np.array([cycle.friction_A for cycle in run]) for run in runs]
        means = np.array([cycles.mean() for cycles in by_run])
        all_cycles = np.concatenate(by_run)
        return cls(float(means.mean()), float(means.std(ddof=1)), float(all_cycles.std(ddof=1)), len(runs))

    def judge(self, friction_A: float, *, single_cycle: bool = False) -> Estimate:
        """Return the fault component `friction` for a friction current [A], with interval and verdict.

        The value is (F / F_healthy - 1) divided by the scale of the component; it is negative for less
        friction than healthy. The interval is Student's prediction interval for one further healthy run (or
        cycle). The mean of many runs has the same interval, because changes between days do not average out.
        The verdict has the rules of a diagnosis (`VERDICT`).
        """
        from scipy.stats import t

        scale = FaultScales().friction * self.mean_A
        deviation = self.cycle_deviation_A if single_cycle else self.deviation_A
        error = deviation * float(np.sqrt(1 + 1 / self.runs)) / scale
        value = friction_A / scale - 1 / FaultScales().friction
        half = float(t.ppf(0.975, self.runs - 1)) * error
        low, high = value - half, value + half
        verdict: Verdict = "cannot tell"
        if low > VERDICT.healthy_margin:
            verdict = "degraded"
        elif max(abs(low), abs(high)) <= VERDICT.hidden_fault:
            verdict = "healthy"
        return Estimate(value, error, (low, high), high - low <= VERDICT.longest_interval, verdict)


def _steady_mean(size: Array, stroke: StrokeSegment) -> float:
    begin = stroke.stop - max(1, round(SETTLED * (stroke.stop - stroke.first)))
    return float(size[begin : stroke.stop].mean())
