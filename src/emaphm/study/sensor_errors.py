"""Recordings with one fault of a sensor each, and what a diagnosis says of them.

``python -m emaphm.study.sensor_errors 5`` prints the table of docs/sensor_faults.md, of 5 cases a fault;
``--sensor``, ``--fault`` and ``--channels`` choose one row of it, and what else is recorded; ``--nuisances``
what is estimated with the faults.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.arrays import Array
from emaphm.diagnosis import Diagnosis, diagnose, error_percent
from emaphm.estimation.sensors.sensor_model import sensor_of
from emaphm.random_streams import stream
from emaphm.recording import Recording, full_scales
from emaphm.study.analysis.rates import holds
from emaphm.study.cases import random_faults
from emaphm.study.record import recorded
from emaphm.study.rig import Manoeuvre, Rig
from emaphm.study.spoilt.judging import wrong_components
from emaphm.text_table import format_table

CHANNELS = ("current_A", "voltage_V", "position_rad", "speed_rad_s")

Kind = Literal["bias", "scale", "drift", "delay", "held", "frozen", "clipped"]
KINDS: tuple[Kind, ...] = ("bias", "scale", "drift", "delay", "held", "frozen", "clipped")

ALL: tuple[tuple[str | None, Kind | None], ...] = (
    (None, None),
    *((channel, kind) for channel in CHANNELS for kind in KINDS),
)
"""Sensors and their faults, first a recording without any."""


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
class SensorFaultOutcome:
    """What a diagnosis said: whether a fault of a sensor was `named`, `rightly`, and what of it is wrong.

    `estimated` says whether it was a parameter of the estimate, named or too small to be. `error` is that of
    the fault vector [%], `held` the share of the components inside their intervals.
    """

    estimated: bool
    named: bool
    rightly: bool
    explained: bool
    wrong: tuple[str, ...]
    error: float
    held: float


def judged(diagnosis: Diagnosis, truth: Faults, channel: str | None, kind: Kind | None) -> SensorFaultOutcome:
    """Return the outcome of a recording whose sensor of `channel` has a fault of `kind`, None without one."""
    found = {(one.channel, one.kind) for one in diagnosis.sensor_faults}
    rightly = found == {(channel, kind)} if kind else not found
    wrong = tuple(wrong_components(diagnosis, truth)) if diagnosis.explained else ()
    held = [
        holds(name, diagnosis.interval[name], true) for name, true in zip(NAMES, truth.vector, strict=True)
    ]
    error = float(error_percent(truth.vector, diagnosis.faults.vector))
    nuisance = f"{sensor_of(channel or '')}_{'offset' if kind == 'bias' else kind}"
    estimated = nuisance in diagnosis.nuisances
    return SensorFaultOutcome(
        estimated, bool(found), rightly, diagnosis.explained, wrong, error, float(np.mean(held))
    )


def rows(
    count: int,
    first_seed: int = 0,
    faults: Sequence[tuple[str | None, Kind | None]] = ALL,
    channels: tuple[str, ...] = CHANNELS,
    nuisances: Sequence[str] | None = None,
) -> Iterator[tuple[str, ...]]:
    """Yield rows of text, one of each of `faults`, as `HEADER` has them, of `count` cases with `channels`.

    `nuisances` as in `emaphm.diagnosis.diagnose`.
    """
    actuator, rig = Actuator.thesis(), Rig(label="sensors", channels=channels)
    for channel, kind in faults:
        outcomes = []
        for seed in range(first_seed, first_seed + count):
            truth = random_faults(seed)
            recording = recorded(rig, actuator, Manoeuvre(), truth, seed)
            if channel is not None and kind is not None:
                recording = spoilt(recording, channel, kind, actuator, seed)
            found = diagnose(recording, actuator, nuisances=nuisances, seed=seed, workers=1)
            outcomes.append(judged(found, truth, channel, kind))
        counted = (
            [one.estimated for one in outcomes],
            [one.named for one in outcomes],
            [one.rightly for one in outcomes],
            [one.explained for one in outcomes],
            [bool(one.wrong) for one in outcomes],
        )
        yield (
            channel or "none",
            kind or "-",
            *(f"{sum(what)} of {count}" for what in counted),
            f"{np.median([one.error for one in outcomes]):.2f} %",
            f"{100 * np.mean([one.held for one in outcomes]):.0f} %",
        )


HEADER = (
    "sensor",
    "fault",
    "estimated",
    "named",
    "rightly",
    "explained",
    "undetected error",
    "median error",
    "intervals that hold",
)


def main() -> None:
    """Print the table that the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m emaphm.study.sensor_errors", description=__doc__)
    parser.add_argument("cases", type=int, nargs="?", default=1, help="random fault vectors of each fault")
    parser.add_argument("--first", type=int, default=0, help="seed of the first of them")
    parser.add_argument("--sensor", choices=CHANNELS, help="a channel; all if left out")
    parser.add_argument("--fault", choices=KINDS, help="a fault; all if left out")
    parser.add_argument("--channels", nargs="+", choices=CHANNELS, default=CHANNELS, help="what is recorded")
    parser.add_argument(
        "--nuisances", nargs="+", help="what is estimated; the default looks for what deviates"
    )
    asked = parser.parse_args()
    chosen = [
        (channel, kind)
        for channel, kind in ALL
        if asked.sensor in (None, channel)
        and asked.fault in (None, kind)
        and (channel is None or channel in asked.channels)
    ]
    table = []
    for row in rows(asked.cases, asked.first, chosen, tuple(asked.channels), asked.nuisances):
        table.append(row)
        sys.stderr.write(" | ".join(row) + "\n")
    sys.stdout.write(format_table(HEADER, table) + "\n")


if __name__ == "__main__":
    main()
