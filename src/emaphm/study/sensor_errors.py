"""Recordings with one fault of a sensor each, and what a diagnosis says of them.

``python -m emaphm.study.sensor_errors 3`` prints the tables of docs/sensor_faults.md, of 3 cases a fault.
"""

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.arrays import Array
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.random_streams import stream
from emaphm.recording import Recording, full_scales
from emaphm.study.cases import random_faults
from emaphm.study.record import recorded
from emaphm.study.rig import Manoeuvre, Rig
from emaphm.text_table import format_table

CHANNELS = ("current_A", "voltage_V", "position_rad", "speed_rad_s")
RIG = Rig(label="sensors", channels=CHANNELS)

Kind = Literal["bias", "scale", "drift", "delay", "held", "frozen", "clipped"]
KINDS: tuple[Kind, ...] = ("bias", "scale", "drift", "delay", "held", "frozen", "clipped")

WRONG = 0.03
"""Error of a component beyond which a definite verdict, two half-widths off, is called confidently wrong."""


@dataclass(frozen=True)
class ErrorSizes:
    """The faults of the study: `bias` and `drift` of the channel's range, `scale` of its value.

    `delay` in rows; `held` is a share of the rows, `frozen` of the duration, `clipped` of the largest value.
    """

    bias: float = 0.01
    scale: float = 0.02
    drift: float = 0.01
    delay: int = 2
    held: float = 0.01
    frozen: float = 0.2
    clipped: float = 0.7


SIZES = ErrorSizes()


def spoilt(recording: Recording, channel: str, kind: Kind, actuator: Actuator, seed: int) -> Recording:
    """Return `recording` with one fault of the sensor of `channel`, of the size in `SIZES`."""
    values = np.array(recording[channel])
    reach, rows = full_scales(actuator)[channel], values.size
    makers: Mapping[Kind, Callable[[], Array]] = {
        "bias": lambda: values + SIZES.bias * reach,
        "scale": lambda: values * (1 + SIZES.scale),
        "drift": lambda: values + SIZES.drift * reach * np.linspace(0.0, 1.0, rows),
        "delay": lambda: np.concatenate([np.full(SIZES.delay, values[0]), values[: -SIZES.delay]]),
        "held": lambda: _held(values, seed),
        "frozen": lambda: _frozen(values),
        "clipped": lambda: np.clip(values, *(SIZES.clipped * np.abs(values).max() * np.array([-1, 1]))),
    }
    return recording.with_channels({**recording.channels, channel: makers[kind]()})


def _held(values: Array, seed: int) -> Array:
    lost = stream(seed, "lost samples").random(values.size) < SIZES.held
    lost[0] = False
    last = np.maximum.accumulate(np.where(lost, 0, np.arange(values.size)))
    return np.asarray(values[last])


def _frozen(values: Array) -> Array:
    first = int(0.4 * values.size)
    result = values.copy()
    result[first : first + int(SIZES.frozen * values.size)] = values[first]
    return result


@dataclass(frozen=True)
class Outcome:
    """What a diagnosis said: whether a fault of a sensor was `named`, `rightly`, and what of it is wrong."""

    named: bool
    rightly: bool
    explained: bool
    wrong: tuple[str, ...]


def judged(diagnosis: Diagnosis, truth: Faults, channel: str | None, kind: Kind | None) -> Outcome:
    """Return the outcome of a recording whose sensor of `channel` has a fault of `kind`, None without one."""
    found = {(one.channel, one.kind) for one in diagnosis.sensor_faults}
    rightly = found == {(channel, kind)} if kind else not found
    wrong = tuple(
        name
        for name, true in zip(NAMES, truth.vector, strict=True)
        if name != "eccentricity_phase" and _confidently_wrong(diagnosis, name, float(true))
    )
    return Outcome(bool(found), rightly, diagnosis.explained, wrong)


def _confidently_wrong(diagnosis: Diagnosis, name: str, truth: float) -> bool:
    one = diagnosis.components[name]
    half = (one.interval95[1] - one.interval95[0]) / 2
    off = abs(one.value - truth) > max(WRONG, 2 * half)
    return diagnosis.explained and one.verdict != "cannot tell" and off


def rows(count: int, first_seed: int = 0) -> Iterator[tuple[str, ...]]:
    """Yield rows of text, one a fault: how many of `count` cases were named, rightly, and are wrong."""
    actuator = Actuator.thesis()
    cases: list[tuple[str | None, Kind | None]] = [(None, None)]
    cases += [(channel, kind) for channel in CHANNELS for kind in KINDS]
    for channel, kind in cases:
        outcomes = []
        for seed in range(first_seed, first_seed + count):
            truth = random_faults(seed)
            recording = recorded(RIG, actuator, Manoeuvre(), truth, seed)
            if channel is not None and kind is not None:
                recording = spoilt(recording, channel, kind, actuator, seed)
            outcomes.append(judged(diagnose(recording, actuator, seed=seed, workers=1), truth, channel, kind))
        yield (
            channel or "none",
            kind or "-",
            *(
                f"{sum(what)} of {count}"
                for what in (
                    [one.named for one in outcomes],
                    [one.rightly for one in outcomes],
                    [one.explained for one in outcomes],
                    [bool(one.wrong) for one in outcomes],
                )
            ),
        )


HEADER = ("sensor", "fault", "named", "rightly", "explained", "confidently wrong")

if __name__ == "__main__":
    table = []
    for row in rows(int(sys.argv[1]) if len(sys.argv) > 1 else 1):
        table.append(row)
        sys.stderr.write(" | ".join(row) + "\n")
    sys.stdout.write(format_table(HEADER, table) + "\n")
