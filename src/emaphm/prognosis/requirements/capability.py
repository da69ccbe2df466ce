"""What an actuator can still do under its faults, by the averaged model: the measures of its requirements."""

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator import Actuator, Chirp, Command, Sine, Step
from emaphm.actuator.requirements import HIGHEST_HZ, LARGEST_STALL_MARGIN, LOWEST_HZ, Requirement
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, OBSERVABLE, Initial, Inputs, Plant, observe_batch

if TYPE_CHECKING:
    from collections.abc import Callable

INTERVAL = 5e-4
"""Between the samples of a manoeuvre, at most [s]."""

SINE_HZ, CHIRP_HZ = 4.0, 15.0
"""Frequency of a sine, and the highest of a chirp, where the requirement gives none [Hz]."""

SAMPLES = 32
"""In a period of a manoeuvre, at least."""

BATCH, BATCH_SAMPLES = 128, 1_000_000
"""Actuators at a time, and their samples: with four channels of 1,000 samples, 4 MB stay in the cache, and a
long manoeuvre takes 32 MB."""

SETTLED = 0.05
"""Share of a step's amplitude within which the position has settled, as usual for servo drives."""

FREQUENCIES, REFINED = 10, 3
"""Sines that the bandwidth is looked for with, a factor of 1.5 from one to the next, and steps that the one
between is divided into: interpolated over a factor of 1.14."""

PERIODS, PERIOD_SAMPLES = 3, 64
"""Of each sine; its amplitude is that of the last period."""

HALVINGS = 7
"""Of the range of loads: what is held is then known to 1/32 of the load."""

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
    samples = requirement.duration / _interval(actuator, requirement)
    at_once = int(np.clip(BATCH_SAMPLES / samples, 1, BATCH))
    return np.concatenate([one(vectors[i : i + at_once]) for i in range(0, len(vectors), at_once)])


def _interval(actuator: Actuator, requirement: Requirement) -> float:
    """Return the time between the samples of its manoeuvre [s].

    Each step of the model for the current: after a step of the command its peak takes less than 1 ms.
    """
    if requirement.measure == "peak_current":
        return AVERAGED.step_for(actuator)
    if requirement.measure == "tracking_error":
        return min(INTERVAL, 1 / (SAMPLES * (requirement.frequency_hz or CHIRP_HZ)))
    return INTERVAL


def _tracking_error(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    command, interval = _manoeuvre(requirement), _interval(actuator, requirement)
    plant = Plant.of(actuator, vectors)
    time, signals = _run(actuator, plant, requirement, command, requirement.duration, interval)
    return np.asarray(np.sqrt(np.mean((command(time) - signals["position_rad"]) ** 2, axis=1)))


def _peak_current(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    command, interval = _manoeuvre(requirement), _interval(actuator, requirement)
    plant = Plant.of(actuator, vectors)
    _, signals = _run(actuator, plant, requirement, command, requirement.duration, interval)
    return np.asarray(np.abs(signals["current_A"]).max(axis=1))


def _settling_time(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    step, plant = Step(requirement.amplitude), Plant.of(actuator, vectors)
    _, signals = _run(actuator, plant, requirement, step, requirement.duration, INTERVAL)
    outside = np.abs(signals["position_rad"] - requirement.amplitude) > SETTLED * requirement.amplitude
    settled = outside.shape[1] - np.argmax(outside[:, ::-1], axis=1)
    # Rounded to what is meant: a limit of 0.022 s is no more and no less than 44 samples.
    times = np.where(outside.any(axis=1), np.round(settled * INTERVAL, 9), 0.0)
    return np.asarray(np.where(outside[:, -1], np.inf, times))


def _bandwidth(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    """Interpolate the amplitude ratio between sines, linearly over the frequency's logarithm."""
    frequencies = np.geomspace(LOWEST_HZ, requirement.frequency_hz or HIGHEST_HZ, FREQUENCIES)
    gains = np.stack([_gain(actuator, requirement, vectors, float(f)) for f in frequencies], axis=1)
    below = gains < MINUS_3_DB
    first = np.argmax(below, axis=1)
    found = np.where(below.any(axis=1), frequencies[0], frequencies[-1])
    for i in np.unique(first[first > 0]):
        rows = np.flatnonzero(first == i)
        closer = np.geomspace(frequencies[i - 1], frequencies[i], REFINED + 1)
        between = [_gain(actuator, requirement, vectors[rows], float(f)) for f in closer[1:-1]]
        found[rows] = _fallen(closer, np.stack([gains[rows, i - 1], *between, gains[rows, i]], axis=1))
    return np.asarray(found)


def _fallen(frequencies: Array, gains: Array) -> Array:
    """Return where the amplitude ratios (n, m) at `frequencies` (m,) first fall to -3 dB, (n,)."""
    first = np.argmax(gains < MINUS_3_DB, axis=1)
    rows, before = np.arange(len(gains)), first - 1
    high, low = gains[rows, before], gains[rows, first]
    share = (high - MINUS_3_DB) / (high - low)
    return np.asarray(frequencies[before] * (frequencies[first] / frequencies[before]) ** share)


def _gain(actuator: Actuator, requirement: Requirement, vectors: Array, frequency: float) -> Array:
    sine, plant = Sine(requirement.amplitude, frequency), Plant.of(actuator, vectors)
    interval = 1 / frequency / PERIOD_SAMPLES
    time, signals = _run(actuator, plant, requirement, sine, PERIODS / frequency, interval)
    turn = np.exp(-2j * np.pi * frequency * time[-PERIOD_SAMPLES:])
    component = signals["position_rad"][:, -PERIOD_SAMPLES:] @ turn * 2 / PERIOD_SAMPLES
    return np.asarray(np.abs(component) / requirement.amplitude)


def _stall_margin(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    """Halve the range of loads; held is one that leaves the position where it shall be, once it is constant.

    It rises over the first half of the duration; in the second half the position is within the amplitude. A
    shaft that slips from a weak phase to the next one, and stands there, is held.
    """
    plant = Plant.of(actuator, vectors)
    structure = plant.structure._replace(load_steps=plant.structure.load_steps + 1)
    rise = np.full(len(vectors), requirement.duration / 2)
    unloaded = requirement.model_copy(update={"load": 0.0})

    def holds(multiple: Array) -> Array:
        risen = np.stack([multiple * requirement.load, rise / 2, rise])
        steps = np.concatenate([plant.load_steps, risen[np.newaxis]])
        loaded = replace(plant, structure=structure, load_steps=steps)
        _, signals = _run(actuator, loaded, unloaded, Step(0.0), requirement.duration, INTERVAL)
        position = signals["position_rad"]
        moved = np.abs(position[:, position.shape[1] // 2 :]).max(axis=1)
        return np.asarray(moved <= requirement.amplitude)

    low, high = np.zeros(len(vectors)), np.full(len(vectors), LARGEST_STALL_MARGIN)
    holds_all = holds(high)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        is_held = holds(middle)
        low, high = np.where(is_held, middle, low), np.where(is_held, high, middle)
    return np.asarray(np.where(holds_all, LARGEST_STALL_MARGIN, low))


def _manoeuvre(requirement: Requirement) -> Command:
    amplitude, frequency = requirement.amplitude, requirement.frequency_hz
    if requirement.command == "step":
        return Step(amplitude)
    if requirement.command == "sine":
        return Sine(amplitude, frequency or SINE_HZ)
    return Chirp(amplitude, stop_hz=frequency or CHIRP_HZ, duration=requirement.duration)


def _run(
    actuator: Actuator,
    plant: Plant,
    requirement: Requirement,
    command: Command,
    duration: float,
    interval: float,
) -> tuple[Array, dict[str, Array]]:
    """Return the times (samples,) and the channels, (n, samples) each; a position is counted from its start.

    A manoeuvre starts at 0, or in the middle of the travel where an end stop is nearer than its amplitude.
    """
    start = actuator.mechanics.start_for(-requirement.amplitude, requirement.amplitude)
    inputs = Inputs.of(
        lambda times: start + command(times),
        requirement.load,
        samples=max(round(duration / interval), 2),
        interval=interval,
        step=AVERAGED.step_for(actuator),
        sampling="instant",
    )
    signals = observe_batch(AVERAGED, plant, inputs, Initial(start / actuator.mechanics.gear_ratio))
    channels = {name: signals[:, i] for i, name in enumerate(OBSERVABLE)}
    return inputs.time_s, channels | {"position_rad": channels["position_rad"] - start}
