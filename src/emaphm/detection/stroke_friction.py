"""Friction from the size of the current alone: strokes in either direction against the same load."""

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
"""Share of a stroke, its last, in which the start has settled and the speed is the command's."""


@dataclass(frozen=True)
class StrokeCurrent:
    """Parts of the current's size on steady strokes: what friction takes, and what the load takes [A].

    With friction F and load L against the motor's torque, both as currents, an up-stroke takes |F - L| and a
    down-stroke |F + L| (the load helps up where it is positive). As long as the load does not drive the
    actuator, |L| < F, half their sum is F and half their difference is L. A current that the drive takes
    without torque is part of `friction_A`: differences of it are friction, its absolute value is an upper
    bound.
    """

    friction_A: float
    load_A: float

    @classmethod
    def of(cls, recording: Recording) -> "StrokeCurrent":
        """Return the parts of the current in a recording of one or more cycles at a constant load.

        Raises
        ------
        RecordingError
            There is no current, or the command does not go both ways.
        """
        if "current_A" not in recording:
            raise RecordingError(
                f"{recording.source}: no current_A, which friction is estimated from; record it"
            )
        size = np.abs(recording["current_A"])
        strokes = strokes_of(recording["command_rad"], DETECTOR)
        ways = [
            [_steady(size, one) for one in strokes if one.stroke == way]
            for way in ("up-stroke", "down-stroke")
        ]
        if not all(ways):
            raise RecordingError(
                f"{recording.source}: the command does not go both ways, so friction cannot be separated "
                "from the load; record an up-stroke and a down-stroke"
            )
        up, down = (float(np.mean(one)) for one in ways)
        return cls((up + down) / 2, (down - up) / 2)


def current_per_load(currents: Sequence[StrokeCurrent], loads: Sequence[float]) -> float:
    """Return the current that a unit of load takes [A/N or A/(N·m)], by least squares through 0.

    NaN where no load is other than 0.
    """
    known = np.asarray(loads, dtype=np.float64)
    measured = np.array([one.load_A for one in currents])
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
                "to say how much friction scatters; record more"
            )
        cycles = [np.array([one.friction_A for one in run]) for run in runs]
        means = np.array([one.mean() for one in cycles])
        every = np.concatenate(cycles)
        return cls(float(means.mean()), float(means.std(ddof=1)), float(every.std(ddof=1)), len(runs))

    def judge(self, friction_A: float, *, single_cycle: bool = False) -> Estimate:
        """Return the fault component `friction` of a friction current [A], with interval and verdict.

        The value is (F / F_healthy - 1) over the scale of the component; below 0 there is less friction than
        in health. The interval is Student's prediction interval for one further healthy run (or cycle): a
        mean of many runs has no shorter one, because what changes between days does not average out. The
        rules of the verdict are those of a diagnosis (`VERDICT`).
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


def _steady(size: Array, stroke: StrokeSegment) -> float:
    begin = stroke.stop - max(1, round(SETTLED * (stroke.stop - stroke.first)))
    return float(size[begin : stroke.stop].mean())
