"""Rows at the start of a recording that was cut within a motion, whose beginning nothing recorded shows.

Without a position a model starts on the command, and without a speed at rest; a coarse position shows no
speed. Where the command moves in the first row already, the shaft does not rest there: it moves, and lags
behind. The loop forgets that within some tens of milliseconds; until then the model is wrong whatever the
faults.
"""

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator import Command, Faults
from emaphm.arrays import Array, root_mean_square
from emaphm.recording.noise import noise_on_most_rows
from emaphm.recording.sensor_checks.resolution import Mask
from emaphm.simulation import AVERAGED, Inputs

if TYPE_CHECKING:
    from emaphm.estimation.problem import Problem


@dataclass(frozen=True)
class UnknownStartSettings:
    """When a recording starts within a motion, and which rows are then not compared.

    The command moves if its rate over the first `window` [s] is above `moving` times the rms of its rate. The
    motion before the recording is simulated over `lead` [s] of the command, extended backwards by the
    parabola through that window. From rest, the model must leave less than `rest` times the rms residual that
    it leaves with the motion before, if the recording is to start at rest. Of 12 chirps with random faults,
    by a simulator that is not part of the project, none passes for a cut one, and of 228 recordings cut out
    of them none for one from rest; from the current alone 4, begun near a turn of the command.

    Rows are left out up to the last one in which both differ by more than `noise` times the noise of the
    channel and by more than `share` of its rms, and up to `most` of all rows. They are compared over
    `longest` [s] at most.
    """

    window: float = 0.01
    moving: float = 0.01
    lead: float = 0.03
    rest: float = 0.75
    noise: float = 1.0
    share: float = 5e-3
    most: float = 0.5
    longest: float = 1.0


UNKNOWN_START = UnknownStartSettings()


def command_moves(problem: "Problem") -> bool:
    """Return whether the command moves in the first row already."""
    rates = np.diff(problem.measured["command_rad"]) / problem.inputs.interval
    _, rate, _ = _parabola(problem)
    return abs(rate) > UNKNOWN_START.moving * root_mean_square(rates)


def rows_of_unknown_start(problem: "Problem") -> int:
    """Return how many rows at the start depend on the motion before it, of a command that moves there.

    Of a recording that does not show its start: `emaphm.estimation.initial_state.shows_start`.
    """
    interval = problem.inputs.interval
    rows = min(problem.samples, max(1, math.ceil(UNKNOWN_START.longest / interval)))
    faults = _likely_faults(problem)
    model = replace(problem, model=AVERAGED)
    at_rest = _outputs(model, faults, rows, lead=0)
    moving = _outputs(model, faults, rows, lead=math.ceil(UNKNOWN_START.lead / interval))
    measured = np.stack([problem.measured[name][:rows] for name in problem.channels])
    apart = np.abs(moving - at_rest).max(axis=0) > _least_difference(problem)[:, np.newaxis]
    if not apart.any():
        return 0
    count = int(np.flatnonzero(apart.any(axis=0))[-1]) + 1
    sizes = np.sqrt(np.mean(measured**2, axis=1, keepdims=True))
    near = [_residual((one - measured) / sizes, count) for one in (at_rest, moving)]
    if near[0] < UNKNOWN_START.rest * near[1]:
        return 0
    return min(count, int(UNKNOWN_START.most * problem.samples))


def masks_of_unknown_start(problem: "Problem", rows: int) -> dict[str, Mask]:
    """Return by compared channel the first `rows` as those that are not compared, (samples,)."""
    mask = np.arange(problem.samples) < rows
    return dict.fromkeys(problem.channels, mask) if rows else {}


def notes_on_start(seconds: float) -> tuple[str, ...]:
    """Return a note where the first `seconds` of a recording are not compared for its unknown start."""
    if not seconds:
        return ()
    note = (
        "the command moves already in the first row, and how the shaft moves there is not known: the first "
        f"{1e3 * seconds:.3g} ms depend on the motion before and are not compared. They are if the recording "
        "starts at rest, or has position_rad and speed_rad_s"
    )
    return (note,)


def _parabola(problem: "Problem") -> tuple[float, float, float]:
    """Return position, rate and acceleration of the command at the start [rad, rad/s, rad/s²]."""
    window = max(UNKNOWN_START.window, 3 * problem.inputs.interval)
    times = np.linspace(0.0, window, 21)
    values = problem.driving.command(times)
    terms = np.stack([times, times**2 / 2], axis=1)
    (rate, acceleration), *_ = np.linalg.lstsq(terms, values - values[0], rcond=None)
    return float(values[0]), float(rate), float(acceleration)


def _likely_faults(problem: "Problem") -> Array:
    """Return fault vectors (n, 8) that change how the actuator follows, and the size of its channels."""
    shorts = (0.0, 0.2) if problem.actuator.electrical is not None else (0.0,)
    return np.array(
        [
            Faults(friction=friction, gain=gain, short_a=short, short_b=short, short_c=short).vector
            for friction, gain, short in product((0.0, 0.5, 1.0), (0.5, 0.0, 1.0), shorts)
        ]
    )


def _outputs(problem: "Problem", faults: Array, rows: int, lead: int) -> Array:
    """Return the channels over the first `rows`, (n, channels, rows), begun `lead` rows before."""
    driving, begin = problem.driving, lead * problem.inputs.interval
    position, rate, acceleration = _parabola(problem)
    lowest, highest = problem.actuator.mechanics.end_stops or (-np.inf, np.inf)

    def command(times: Array) -> Array:
        since = times - begin
        before = np.clip(position + rate * since + acceleration * since**2 / 2, lowest, highest)
        return np.where(since < 0, before, driving.command(np.maximum(since, 0.0)))

    inputs = Inputs.of(
        command,
        _later(driving.load, begin) if callable(driving.load) else driving.load,
        samples=lead + rows,
        interval=problem.inputs.interval,
        step=problem.model.step_for(problem.actuator),
        sampling=driving.sampling,
        enabled=_later(driving.enabled, begin) if driving.enabled is not None else None,
    )
    start, ratio = problem.start, problem.actuator.mechanics.gear_ratio
    if lead:
        first = start.angle * ratio + float(command(np.zeros(1))[0]) - position
        start = replace(start, angle=float(np.clip(first, lowest, highest)) / ratio)
    return np.asarray(replace(problem, inputs=inputs, start=start).predict(faults)[:, :, lead:])


def _later(signal: Command, begin: float) -> Command:
    """Return a function of time [s] as one that begins later, and holds its first value until then."""
    return lambda times: signal(np.maximum(times - begin, 0.0))


def _least_difference(problem: "Problem") -> Array:
    """Return the difference that counts in each channel, in its unit, (channels,)."""
    rows = [problem.measured[name] for name in problem.channels]
    noise = [
        max(noise_on_most_rows(one), problem.counts.get(name, 0.0))
        for name, one in zip(problem.channels, rows, strict=True)
    ]
    sizes = [root_mean_square(one) for one in rows]
    return np.maximum(UNKNOWN_START.noise * np.array(noise), UNKNOWN_START.share * np.array(sizes))


def _residual(residuals: Array, count: int) -> float:
    """Return the least rms over `count` rows among relative `residuals` (n, channels, rows)."""
    return float(np.sqrt(np.mean(residuals[:, :, :count] ** 2, axis=(1, 2)).min()))
