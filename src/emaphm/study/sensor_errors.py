"""Study of recordings with one sensor fault each: detection of this fault, and accuracy of the diagnosis.

``python -m emaphm.study.sensor_errors 5`` prints the table of docs/sensor_faults.md, with 5 cases per fault;
``--sensor`` and ``--fault`` select a row of it, ``--channels`` the recorded channels, ``--nuisances`` the
nuisances estimated with the faults.
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
from emaphm.errors import EmaphmError
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
"""Sensors and their faults; the first is a recording without a sensor fault."""


@dataclass(frozen=True)
class ErrorSizes:
    """Sizes of the sensor faults: `bias` and `drift` relative to the channel's range, `scale` to its value.

    `delay` is in rows; `held` is a share of the rows, `frozen` of the duration, `clipped` of the largest
    value.
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
    full_scale, rows = full_scales(actuator)[channel], values.size
    makers: Mapping[Kind, Callable[[], Array]] = {
        "bias": lambda: values + SIZES.bias * full_scale,
        "scale": lambda: values * (1 + SIZES.scale),
        "drift": lambda: values + SIZES.drift * full_scale * np.linspace(0.0, 1.0, rows),
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
    """Result of a diagnosis: whether a sensor fault was `named`, and `rightly`; and the `wrong` components.

    `estimated`: whether the sensor fault was a parameter of the estimate, also if it was too small to be
    named. `error`: error of the fault vector [%]. `held`: share of the components within their intervals.
    """

    estimated: bool
    named: bool
    rightly: bool
    explained: bool
    wrong: tuple[str, ...]
    error: float
    held: float


def judged(diagnosis: Diagnosis, truth: Faults, channel: str | None, kind: Kind | None) -> SensorFaultOutcome:
    """Return the outcome of a recording whose sensor of `channel` has a fault of a `kind`, or none (None)."""
    named = {(fault.channel, fault.kind) for fault in diagnosis.sensor_faults}
    rightly = named == {(channel, kind)} if kind else not named
    wrong = tuple(wrong_components(diagnosis, truth)) if diagnosis.explained else ()
    held = [
        holds(name, diagnosis.interval[name], true) for name, true in zip(NAMES, truth.vector, strict=True)
    ]
    error = float(error_percent(truth.vector, diagnosis.faults.vector))
    nuisance = f"{sensor_of(channel or '')}_{'offset' if kind == 'bias' else kind}"
    estimated = nuisance in diagnosis.nuisances
    return SensorFaultOutcome(
        estimated, bool(named), rightly, diagnosis.explained, wrong, error, float(np.mean(held))
    )


def rows(
    count: int,
    first_seed: int = 0,
    faults: Sequence[tuple[str | None, Kind | None]] = ALL,
    channels: tuple[str, ...] = CHANNELS,
    nuisances: Sequence[str] | None = None,
) -> Iterator[tuple[str, ...]]:
    """Yield a row of text with the columns of `HEADER` for each of `faults`, from `count` cases each.

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
            diagnosis = diagnose(recording, actuator, nuisances=nuisances, seed=seed, workers=1)
            outcomes.append(judged(diagnosis, truth, channel, kind))
        counted = (
            [outcome.estimated for outcome in outcomes],
            [outcome.named for outcome in outcomes],
            [outcome.rightly for outcome in outcomes],
            [outcome.explained for outcome in outcomes],
            [bool(outcome.wrong) for outcome in outcomes],
        )
        yield (
            channel or "none",
            kind or "-",
            *(f"{sum(flags)} of {count}" for flags in counted),
            f"{np.median([outcome.error for outcome in outcomes]):.2f} %",
            f"{100 * np.mean([outcome.held for outcome in outcomes]):.0f} %",
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
    """Print the table for the arguments of the command line."""
    parser = argparse.ArgumentParser(prog="python -m emaphm.study.sensor_errors", description=__doc__)
    parser.add_argument(
        "cases", type=int, nargs="?", default=1, help="number of random fault vectors per sensor fault"
    )
    parser.add_argument("--first", type=int, default=0, help="seed of the first fault vector")
    parser.add_argument("--sensor", choices=CHANNELS, help="channel of the sensor; default all channels")
    parser.add_argument("--fault", choices=KINDS, help="kind of sensor fault; default all kinds")
    parser.add_argument("--channels", nargs="+", choices=CHANNELS, default=CHANNELS, help="recorded channels")
    parser.add_argument(
        "--nuisances",
        nargs="*",
        help="estimated nuisances, none if nothing follows; default those that deviate significantly",
    )
    arguments = parser.parse_args()
    if arguments.cases < 1:
        parser.error(f"{arguments.cases} cases: give 1 or more")
    if arguments.first < 0:
        parser.error(f"--first {arguments.first}: give 0 or more")
    if "current_A" not in arguments.channels:
        parser.error("--channels: 'current_A' is missing; a diagnosis needs it")
    chosen = [
        (channel, kind)
        for channel, kind in ALL
        if arguments.sensor in (None, channel)
        and arguments.fault in (None, kind)
        and (channel is None or channel in arguments.channels)
    ]
    if not chosen:
        parser.error(f"--sensor {arguments.sensor}: is not recorded; name it under --channels too")
    table = []
    for row in rows(arguments.cases, arguments.first, chosen, tuple(arguments.channels), arguments.nuisances):
        table.append(row)
        sys.stderr.write(" | ".join(row) + "\n")
    sys.stdout.write(format_table(HEADER, table) + "\n")


if __name__ == "__main__":
    try:
        main()
    except EmaphmError as error:
        sys.exit(f"error: {error}")
