"""Plausibility checks: wrong units and useless channels, from a comparison with the actuator's limits.

Each rule accepts any healthy or faulty actuator and refuses only errors of orders of magnitude.
"""

import math

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.quantity import unit_for
from emaphm.arrays import Array
from emaphm.errors import RecordingError
from emaphm.recording.angle_unit import angle_unit_complaint
from emaphm.recording.checks import COUNTING
from emaphm.recording.io.limits import WAY_OUT
from emaphm.recording.recording import Recording
from emaphm.recording.schema import CURRENTS, SCHEMA
from emaphm.recording.time_unit import time_unit_complaint

MOST_ROWS = 200_000
"""Longest recording that models are fitted to [rows]: 40 s at 5 kHz. A row takes up to 12 kB and 0.5 ms of a
diagnosis, hence 2 GB and two minutes in all (``/usr/bin/time -v emaphm diagnose`` of simulated recordings of
10,000 to 500,000 rows)."""

LONGEST_S = 500.0
"""Longest duration that models are fitted to [s]: a model's own steps take memory and time at any row
rate."""

SMALLEST, LARGEST = 1e-15, 1e15
"""Limits of a channel's magnitude, in its SI unit: no sensor of an actuator comes near them, and squares and
products of values between them stay finite and above 0."""

LONGEST_INTERVAL_S = 0.15
"""Longest interval between rows [s]: below 10 Hz, with a margin for jitter, rows show the position of an
actuator but not its dynamics. Milliseconds taken for seconds give such intervals up to 7 kHz; for faster rows
see `recording.time_unit`."""

SMALLER_UNITS = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
"""Units of time that a logger may count in [s]."""

FASTEST_INTERVAL_S = 1e-5
"""Least interval that a suggested unit must give [s]: usual loggers are no faster than 100 kHz."""

SHORTEST_INTERVAL_S = 1e-7
"""Shortest interval between rows [s]: a tenth of the reference model's own step."""

BEYOND_END_STOPS = 3.0
BEYOND_LIMIT = 5.0
"""Factors over the hardware's limits; noise and overshoot stay well below, unit errors (57, 1000) far
above."""

MOTION_RATIO = 20.0
"""Largest ratio of the rms of position and command, in either direction: below 57.3 (degrees), above any
loop's resonance."""

LEAST_CORRELATION = 0.5
"""Least correlation of position and command at which the position follows the command."""

FRICTION_SHARE = 0.05
"""Least ratio of a moving motor's peak current to the current that overcomes its friction; kiloamperes give
less. Also the least ratio of the peak speed to the mean speed of the motion."""

HOTTEST_K = 1000.0
"""Highest plausible temperature: copper and magnets of no motor survive it."""

COLDEST_K = 150.0
"""Lowest plausible temperature: no actuator works below. Celsius taken for kelvin lies below."""

ROTARY_UNITS = {"degrees": 180 / math.pi, "milliradians": 1e3}
LINEAR_UNITS = {"millimetres": 1e3, "micrometres": 1e6}


def check_plausible(recording: Recording, actuator: Actuator) -> None:
    """Refuse a recording whose units are wrong by orders of magnitude, or that no model can be fitted to.

    Parameters
    ----------
    recording
        Recording to check.
    actuator
        Gives the limits: end stops, current and speed limit, friction.

    Raises
    ------
    RecordingError
        A channel is far outside what the actuator can do, the current is 0 throughout, or the recording is
        too long; the message names the likely cause and the remedy.
    """
    complaint = (
        _length(recording)
        or _interval(recording)
        or time_unit_complaint(recording, actuator)
        or _motion(recording, actuator)
        or angle_unit_complaint(recording, actuator)
        or _end_stops(recording, actuator)
        or _no_current(recording)
        or _high_current(recording, actuator)
        or _low_current(recording, actuator)
        or _speed(recording, actuator)
        or _low_speed(recording, actuator)
        or _voltage(recording, actuator)
        or _duty(recording)
        or _enabled(recording)
        or _load(recording, actuator)
        or _temperature(recording)
        or _magnitude(recording, actuator)
    )
    if complaint:
        raise RecordingError(f"{recording.source}: {complaint}")


def check_rate_and_current(recording: Recording, actuator: Actuator) -> None:
    """Refuse a recording of any length with slow rows, or a current orders of magnitude beyond its limit.

    Raises
    ------
    RecordingError
        The interval between rows or the current is beyond its limit; the message names the likely unit and
        the remedy.
    """
    if complaint := _interval(recording) or _high_current(recording, actuator):
        raise RecordingError(f"{recording.source}: {complaint}")


def _length(recording: Recording) -> str | None:
    if recording.samples > MOST_ROWS:
        return f"has {recording.samples:,} rows, a model is fitted to {MOST_ROWS:,} at most; {WAY_OUT}"
    if recording.duration_s > LONGEST_S and recording.interval_s <= LONGEST_INTERVAL_S:
        return f"takes {recording.duration_s:,.0f} s, a model is fitted to {LONGEST_S:g} s at most; {WAY_OUT}"
    return None


def _interval(recording: Recording) -> str | None:
    interval = recording.interval_s
    if interval > LONGEST_INTERVAL_S:
        units = [
            name
            for name, size in SMALLER_UNITS.items()
            if FASTEST_INTERVAL_S <= size * interval <= LONGEST_INTERVAL_S
        ]
        unit = f"in {' or '.join(units)}" if units else "not in s"
        return (
            f"rows are {interval:.4g} s apart, more than {LONGEST_INTERVAL_S:g} s; if time_s is {unit} "
            "convert it to s, else sample faster"
        )
    if interval < SHORTEST_INTERVAL_S:
        return (
            f"rows are {interval:.4g} s apart, less than {SHORTEST_INTERVAL_S:g} s; time_s must be in s, "
            "convert it"
        )
    return None


def _end_stops(recording: Recording, actuator: Actuator) -> str | None:
    if actuator.mechanics.end_stops is None:
        return None
    farthest = max(map(abs, actuator.mechanics.end_stops))
    for name in ("command_rad", "position_rad"):
        reached, row = _peak(recording, name)
        if reached > BEYOND_END_STOPS * farthest:
            return (
                f"{name} reaches {reached:.4g} at row {row}, the end stops are at {farthest:.4g}; it seems "
                f"to be in {' or '.join(_user_units(actuator))}: convert it to {_si_unit(actuator)} "
                f"({COUNTING})"
            )
    return None


def _motion(recording: Recording, actuator: Actuator) -> str | None:
    if not _follows(recording):
        return None
    ratio = _deviation(recording["position_rad"])[1] / _deviation(recording["command_rad"])[1]
    if 1 / MOTION_RATIO <= ratio <= MOTION_RATIO:
        return None
    larger, times = ("position_rad", ratio) if ratio > 1 else ("command_rad", 1 / ratio)
    units = _user_units(actuator)
    unit = min(units, key=lambda name: abs(math.log(times / units[name])))
    return (
        f"position_rad swings {ratio:.4g} times as far as command_rad; {larger} seems to be in {unit}: "
        f"convert it to {_si_unit(actuator)}"
    )


def _no_current(recording: Recording) -> str | None:
    if "current_A" not in recording or np.any(recording["current_A"]):
        return None
    return (
        "current_A is 0 throughout: nothing was measured; check the sensor and its channel, or leave the "
        "column out"
    )


def _high_current(recording: Recording, actuator: Actuator) -> str | None:
    limit = actuator.controller.current_limit
    for name in CURRENTS:
        reached, row = _peak(recording, name)
        if reached > BEYOND_LIMIT * limit:
            return (
                f"{name} reaches {reached:.4g} at row {row}, the current limit is {limit:.4g}; it seems to "
                f"be in milliamperes or raw counts: convert it to A ({COUNTING})"
            )
    return None


def _low_current(recording: Recording, actuator: Actuator) -> str | None:
    # A small current alone is plausible; a small current that moves a motor with friction is not.
    needed = actuator.mechanics.dynamic_friction / actuator.motor.torque_constant
    if "current_A" not in recording or not _follows(recording):
        return None
    reached, _ = _peak(recording, "current_A")
    if reached >= FRICTION_SHARE * needed:
        return None
    return (
        f"current_A stays below {reached:.4g} while the position moves, yet friction alone takes "
        f"{needed:.4g}; it seems to be in kiloamperes or normalised: convert it to A"
    )


def _speed(recording: Recording, actuator: Actuator) -> str | None:
    limit = actuator.controller.speed_limit
    reached, row = _peak(recording, "speed_rad_s")
    if limit is None or reached <= BEYOND_LIMIT * limit:
        return None
    unit, si = ("mm/s", "m/s") if actuator.has_linear_motor else ("rpm or deg/s", "rad/s")
    return (
        f"speed_rad_s reaches {reached:.4g} at row {row}, the speed limit is {limit:.4g}; it seems to be in "
        f"{unit}: convert it to {si} ({COUNTING})"
    )


def _low_speed(recording: Recording, actuator: Actuator) -> str | None:
    if "speed_rad_s" not in recording or not _follows(recording):
        return None
    # The largest speed is at least the mean speed over the travelled distance.
    needed = float(np.ptp(recording["position_rad"])) / (actuator.mechanics.gear_ratio * recording.duration_s)
    reached, _ = _peak(recording, "speed_rad_s")
    # A column of zeros means that no sensor was connected: no model is compared with it.
    if reached == 0 or reached >= FRICTION_SHARE * needed:
        return None
    return (
        f"speed_rad_s stays below {reached:.4g}, yet the motion of the position takes {needed:.4g} on "
        "average; give the motor's speed, and in its SI unit"
    )


def _voltage(recording: Recording, actuator: Actuator) -> str | None:
    if actuator.electrical is None:
        return None
    for name in ("voltage_V", "voltage_d_V", "voltage_q_V", "supply_V"):
        reached, row = _peak(recording, name)
        if reached > BEYOND_LIMIT * actuator.electrical.supply:
            return (
                f"{name} reaches {reached:.4g} at row {row}, the supply is {actuator.electrical.supply:.4g}; "
                f"it seems to be in millivolts or raw counts: convert it to V ({COUNTING})"
            )
    return None


def _duty(recording: Recording) -> str | None:
    reached, row = _peak(recording, "duty")
    if reached <= BEYOND_LIMIT:
        return None
    return (
        f"duty reaches {reached:.4g} at row {row}, the whole supply is 1; it seems to be in percent or raw "
        f"counts: divide it by what stands for the whole supply ({COUNTING})"
    )


def _enabled(recording: Recording) -> str | None:
    if "enabled" not in recording:
        return None
    wrong = np.flatnonzero((recording["enabled"] != 0) & (recording["enabled"] != 1))
    if not wrong.size:
        return None
    return (
        f"enabled is {recording['enabled'][wrong[0]]:.4g} at row {wrong[0] + 1}; give 1 where the drive is "
        f"switched on, 0 where it is off ({COUNTING})"
    )


def _load(recording: Recording, actuator: Actuator) -> str | None:
    # The largest load that the motor can hold, at the current limit.
    holding_torque = actuator.motor.torque_constant * actuator.controller.current_limit
    reached, row = _peak(recording, "load_Nm")
    if reached <= BEYOND_LIMIT * holding_torque:
        return None
    unit = "N" if actuator.has_linear_motor else "N·m"
    return (
        f"load_Nm reaches {reached:.4g} at row {row}, the motor holds {holding_torque:.4g} at its current "
        f"limit; it seems to be the load at the user: refer it to the motor shaft, in {unit} ({COUNTING})"
    )


def _temperature(recording: Recording) -> str | None:
    if "temperature_K" not in recording:
        return None
    reached, row = _peak(recording, "temperature_K")
    if reached > HOTTEST_K:
        return (
            f"temperature_K reaches {reached:.4g} at row {row}, which no motor survives: convert it to K "
            f"({COUNTING})"
        )
    row = int(np.argmin(recording["temperature_K"]))
    coldest = recording["temperature_K"][row]
    if coldest >= COLDEST_K:
        return None
    return (
        f"temperature_K is {coldest:.4g} at row {row + 1}; it seems to be in degrees Celsius: add 273.15 "
        f"({COUNTING})"
    )


def _magnitude(recording: Recording, actuator: Actuator) -> str | None:
    for name in filter(recording.__contains__, SCHEMA):
        reached, row = _peak(recording, name)
        unit = unit_for(SCHEMA[name].unit, actuator.coordinates)
        if reached > LARGEST:
            return (
                f"{name} reaches {reached:.4g} at row {row}, which no sensor gives; correct that value, or "
                f"convert the column to {unit} ({COUNTING})"
            )
        if 0 < reached < SMALLEST:
            return (
                f"{name} reaches only {reached:.4g}, at row {row}, which no sensor resolves; convert it to "
                f"{unit}, or leave the column out ({COUNTING})"
            )
    return None


def _peak(recording: Recording, name: str) -> tuple[float, int]:
    """Return the largest magnitude in a column and its row number, 0 for both if the column is absent."""
    if name not in recording:
        return 0.0, 0
    row = int(np.argmax(np.abs(recording[name])))
    return float(abs(recording[name][row])), row + 1


def _deviation(values: Array) -> tuple[Array, float]:
    """Return the deviations (n,) from the mean, divided by their rms, and that rms, without overflow."""
    largest = float(np.abs(values).max()) or 1.0
    scaled = values / largest
    scaled = scaled - scaled.mean()
    rms = float(np.sqrt(np.mean(scaled**2)))
    return (scaled / rms, rms * largest) if rms > 0 else (scaled, 0.0)


def _follows(recording: Recording) -> bool:
    """Return whether the position is correlated with the command, in any unit.

    The position of a jammed actuator, or of one that never left its backlash, is not; its unit may be right.
    """
    if "position_rad" not in recording:
        return False
    command, _ = _deviation(recording["command_rad"])
    position, _ = _deviation(recording["position_rad"])
    return bool(np.mean(command * position) > LEAST_CORRELATION)


def _user_units(actuator: Actuator) -> dict[str, float]:
    return LINEAR_UNITS if actuator.has_linear_user else ROTARY_UNITS


def _si_unit(actuator: Actuator) -> str:
    return "m" if actuator.has_linear_user else "rad"
