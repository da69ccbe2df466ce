"""Conversion of the text of options to objects, with refusal of invalid text."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from emaphm.errors import FaultError, MethodError, RecordingError, SignalError

if TYPE_CHECKING:
    from emaphm.actuator import Actuator, Faults, Load, Sampled

CLOSE = 0.85
"""Similarity ratio of a name to a channel's name from which it is taken for a misspelling."""


def check_seed(seed: int) -> None:
    """Refuse a negative seed, which random generators do not accept."""
    if seed < 0:
        raise SignalError(f"--seed {seed} is negative; give 0 or more")


def check_noise(noise: float, actuator: "Actuator") -> None:
    """Refuse a --noise that is no rms of a current, or exceeds the current limit of the actuator."""
    if not 0 <= noise < math.inf:
        raise SignalError(f"--noise {noise:g} is no valid rms; give 0 or more")
    if noise > (limit := actuator.controller.current_limit):
        raise SignalError(
            f"--noise {noise:g} A exceeds the current limit of {limit:g} A; give the sensor's rms"
        )


def check_fast(fast: bool, estimator: Path | None) -> None:
    """Refuse --fast without an estimator."""
    if fast and estimator is None:
        raise MethodError("--fast returns an estimator's answer; name its file: --estimator FILE")


def check_output(path: Path | None, endings: tuple[str, ...], *, force: bool) -> None:
    """Refuse an output that cannot be written, before the work whose result would be lost."""
    from emaphm.output_files import check_writable

    if path is not None:
        check_writable(path, force=force, endings=endings)


def described_actuator(name: str) -> "Actuator":
    """Return the actuator named by --actuator."""
    from emaphm.actuator import Actuator

    return Actuator.load(name)


def recording_of(path: Path, actuator: "Actuator", known: tuple[str, ...] = ()) -> Any:
    """Return the recording in a file, with the channels of `actuator` and the values of --known."""
    from emaphm.recording import read_recording

    return read_recording(path, actuator, known=known_values(known))


def known_values(assignments: tuple[str, ...]) -> dict[str, float | str]:
    """Return the values of the --known options by name: numbers of channels, texts of labels."""
    from emaphm.actuator.quantity import unit_for
    from emaphm.recording.schema import SCHEMA

    values: dict[str, float | str] = {}
    for assignment in assignments:
        name, equals, value = (part.strip() for part in assignment.partition("="))
        if not (name and equals and value):
            raise RecordingError(f"--known {assignment}: give NAME=VALUE, e.g. temperature_K=300")
        if name in values:
            raise RecordingError(f"--known {name} is given twice; give it once")
        if name not in SCHEMA:
            _check_label(name, value)
            values[name] = value
            continue
        try:
            values[name] = float(value)
        except ValueError:
            unit = unit_for(SCHEMA[name].unit, "rotary")
            raise RecordingError(f"--known {assignment}: {name} is a number in {unit}") from None
    return values


def _check_label(name: str, value: str) -> None:
    """Refuse a number whose name resembles a channel's: as a label it would have no effect."""
    from difflib import get_close_matches

    from emaphm.recording.schema import SCHEMA

    try:
        float(value)
    except ValueError:
        return
    with_unit = ("load_Nm", "temperature_K", "supply_V")
    channels = {channel.lower().rpartition("_")[0]: channel for channel in with_unit}
    channels |= {channel.lower(): channel for channel in SCHEMA}
    for close in get_close_matches(name.lower(), channels, n=1, cutoff=CLOSE):
        raise RecordingError(
            f"--known {name}={value}: no channel has that name (did you mean '{channels[close]}'?); for a "
            "label give another name"
        )


def fault_vector(assignments: tuple[str, ...]) -> "Faults":
    """Return the faults set by the --fault options."""
    from emaphm.actuator import Faults

    values = {}
    for assignment in assignments:
        name, _, value = assignment.partition("=")
        if name.strip() in values:
            raise FaultError(f"--fault {name.strip()} is given twice; give each fault once")
        try:
            values[name.strip()] = float(value)
        except ValueError:
            raise FaultError(f"--fault {assignment}: give NAME=VALUE, e.g. friction=0.25") from None
    return Faults.from_mapping(values)


def load_named(value: str, duration: float) -> "Load":
    """Return the load given by --load: a number, or the signal in a file."""
    try:
        return float(value)
    except ValueError:
        if not Path(value).suffix:
            raise SignalError(f"--load {value} is neither a number nor a file; give e.g. 0.05") from None
        return signal_in(value, "load_Nm", duration)


def signal_in(path: str, name: str, duration: float) -> "Sampled":
    """Return the signal `name` in a file; it must have rows within the `duration` [s] of the simulation."""
    from emaphm.recording import read_signal

    signal = read_signal(path, name)
    first, last = signal.time_s[0], signal.time_s[-1]
    if first >= duration or last <= 0:
        raise SignalError(
            f"{path}: time_s runs from {first:g} to {last:g} s, the simulation from 0 to {duration:g} s; "
            "shift the times to start at 0"
        )
    return signal


def names_in(text: str) -> list[str]:
    """Return the names in `text`, separated by commas; an empty list for "none"."""
    names = [name.strip() for name in text.split(",") if name.strip()]
    if "none" in names and len(names) > 1:
        raise MethodError(f"'{text}': give 'none' alone, or the names")
    return [] if names == ["none"] else names
