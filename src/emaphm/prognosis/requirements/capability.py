"""What an actuator can still do under its faults, by the averaged model: the measures of its requirements."""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator import Actuator, Chirp, Command, Load, Sine, Step
from emaphm.actuator.requirements import HIGHEST_HZ, LARGEST_STALL_MARGIN, LOWEST_HZ, Requirement
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, OBSERVABLE, Inputs, Plant, observe_batch

if TYPE_CHECKING:
    from collections.abc import Callable

INTERVAL = 5e-4
"""Between the samples of a manoeuvre, at most [s]."""

SINE_HZ, CHIRP_HZ = 4.0, 15.0
"""Frequency of a sine, and the highest of a chirp, where the requirement gives none [Hz]."""

SAMPLES = 32
"""In a period of a manoeuvre, at least: its largest current is between samples by 0.5 % at most."""

BATCH = 128
"""Actuators at a time: with four channels of 1,000 samples, 4 MB, which stay in the cache."""

SETTLED = 0.05
"""Share of a step's amplitude within which the position has settled, as usual for servo drives."""

FREQUENCIES = 10
"""Sines that the bandwidth is interpolated between: a factor of 1.5 from one to the next."""

PERIODS, PERIOD_SAMPLES = 3, 64
"""Of each sine; its amplitude is that of the last period."""

FULL, RUN_AWAY = 0.99, 0.05
"""Share of the largest current, from which on there is hardly more to come; share of the amplitude that the
position goes on giving way with that current, where the motor has stalled."""

MINUS_3_DB = 1 / np.sqrt(2)
"""Amplitude ratio of -3 dB."""


def measured(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    """Return the requirement's measure of `actuator` under each of the fault `vectors` (n, 8), shape (n,).

    Units and definitions as in `Requirement`. A step that does not settle within its duration has an infinite
    settling time; a bandwidth or stall margin outside the range that is looked at is that range's end.

    Raises
    ------
    MethodError
        The simulation did not stay finite.
    """
    if requirement.measure == "free_play":
        return np.asarray(Plant.of(actuator, vectors).backlash * actuator.mechanics.gear_ratio)
    by_name: dict[str, Callable[[Actuator, Requirement, Array], Array]] = {
        "tracking_error": _tracking_error,
        "bandwidth": _bandwidth,
        "settling_time": _settling_time,
        "stall_margin": _stall_margin,
        "peak_current": _peak_current,
    }
    one = partial(by_name[str(requirement.measure)], actuator, requirement)
    return np.concatenate([one(vectors[i : i + BATCH]) for i in range(0, len(vectors), BATCH)])


def _tracking_error(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    command = _manoeuvre(requirement)
    time, signals = _run(
        actuator, vectors, command, requirement.load, requirement.duration, _interval(requirement)
    )
    return np.asarray(np.sqrt(np.mean((command(time) - signals["position_rad"]) ** 2, axis=1)))


def _peak_current(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    command = _manoeuvre(requirement)
    _, signals = _run(
        actuator, vectors, command, requirement.load, requirement.duration, _interval(requirement)
    )
    return np.asarray(np.abs(signals["current_A"]).max(axis=1))


def _settling_time(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    step = Step(requirement.amplitude)
    time, signals = _run(actuator, vectors, step, requirement.load, requirement.duration, INTERVAL)
    outside = np.abs(signals["position_rad"] - requirement.amplitude) > SETTLED * requirement.amplitude
    last = outside.shape[1] - 1 - np.argmax(outside[:, ::-1], axis=1)
    times = np.where(outside.any(axis=1), time[last] + INTERVAL, 0.0)
    return np.asarray(np.where(outside[:, -1], np.inf, times))


def _bandwidth(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    """Interpolate the amplitude ratio between sines, linearly over the frequency's logarithm."""
    frequencies = np.geomspace(LOWEST_HZ, requirement.frequency_hz or HIGHEST_HZ, FREQUENCIES)
    gains = np.stack([_gain(actuator, requirement, vectors, float(f)) for f in frequencies], axis=1)
    below = gains < MINUS_3_DB
    first = np.argmax(below, axis=1)
    rows, before = np.arange(len(vectors)), np.maximum(first - 1, 0)
    high, low = gains[rows, before], gains[rows, first]
    share = np.clip((high - MINUS_3_DB) / np.maximum(high - low, 1e-12), 0, 1)
    found = frequencies[before] * (frequencies[first] / frequencies[before]) ** share
    return np.asarray(np.where(below.any(axis=1), found, frequencies[-1]))


def _gain(actuator: Actuator, requirement: Requirement, vectors: Array, frequency: float) -> Array:
    sine = Sine(requirement.amplitude, frequency)
    interval = 1 / frequency / PERIOD_SAMPLES
    time, signals = _run(actuator, vectors, sine, requirement.load, PERIODS / frequency, interval)
    turn = np.exp(-2j * np.pi * frequency * time[-PERIOD_SAMPLES:])
    component = signals["position_rad"][:, -PERIOD_SAMPLES:] @ turn * 2 / PERIOD_SAMPLES
    return np.asarray(np.abs(component) / requirement.amplitude)


def _stall_margin(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    """Raise the load evenly up to its largest multiple, until the position is off by the amplitude.

    A soft position loop gives way in proportion to the load, and so does the current. A motor that stalls
    is run away with at its largest current, while the load goes on rising: what it held is the load at which
    the current reached 99 % of that.
    """

    def load(time: Array) -> Array:
        return LARGEST_STALL_MARGIN * requirement.load * time / requirement.duration

    time, signals = _run(actuator, vectors, Step(0.0), load, requirement.duration, INTERVAL)
    moved, current = np.abs(signals["position_rad"]) / requirement.amplitude, np.abs(signals["current_A"])
    gives_way = (moved > 1).any(axis=1)
    ends = np.where(gives_way, np.argmax(moved > 1, axis=1), time.size - 1)
    current[np.arange(time.size) > ends[:, np.newaxis]] = 0.0
    full = np.argmax(current >= FULL * current.max(axis=1, keepdims=True), axis=1)
    rows = np.arange(len(vectors))
    stalled = moved[rows, ends] - moved[rows, full] > RUN_AWAY
    held = np.where(stalled, time[full], np.where(gives_way, time[ends], requirement.duration))
    return np.asarray(LARGEST_STALL_MARGIN * held / requirement.duration)


def _interval(requirement: Requirement) -> float:
    """Return the time between the samples of its manoeuvre [s]."""
    return min(INTERVAL, 1 / (SAMPLES * (requirement.frequency_hz or CHIRP_HZ)))


def _manoeuvre(requirement: Requirement) -> Command:
    amplitude, frequency = requirement.amplitude, requirement.frequency_hz
    if requirement.command == "step":
        return Step(amplitude)
    if requirement.command == "sine":
        return Sine(amplitude, frequency or SINE_HZ)
    return Chirp(amplitude, stop_hz=frequency or CHIRP_HZ, duration=requirement.duration)


def _run(
    actuator: Actuator, vectors: Array, command: Command, load: Load, duration: float, interval: float
) -> tuple[Array, dict[str, Array]]:
    inputs = Inputs.of(
        command,
        load,
        samples=max(round(duration / interval), 2),
        interval=interval,
        step=AVERAGED.step_for(actuator),
        sampling="instant",
    )
    signals = observe_batch(AVERAGED, Plant.of(actuator, vectors), inputs)
    return inputs.time_s, {name: signals[:, i] for i, name in enumerate(OBSERVABLE)}
