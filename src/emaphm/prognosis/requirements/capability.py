"""Measures of the requirements of an actuator with faults, computed by the averaged model."""

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
"""Largest time between samples of a manoeuvre [s]."""

SINE_HZ, CHIRP_HZ = 4.0, 15.0
"""Default frequency of a sine, and default highest frequency of a chirp [Hz]."""

SAMPLES = 32
"""Smallest number of samples per period of a manoeuvre."""

BATCH, BATCH_SAMPLES = 128, 1_000_000
"""Largest number of actuators simulated together, and of their samples: with four channels of 1,000 samples,
4 MB fit into the cache, and a long manoeuvre needs 32 MB."""

SETTLED = 0.05
"""Share of a step's amplitude within which the position has settled, as usual for servo drives."""

FREQUENCIES, REFINED = 10, 3
"""Number of sines for the search of the bandwidth, with a frequency ratio of 1.5, and of subdivisions of the
interval that contains it: the interpolation is over a ratio of 1.14."""

PERIODS, PERIOD_SAMPLES = 3, 64
"""Periods of each sine, and samples per period; the amplitude is taken from the last period."""

HALVINGS = 7
"""Bisections of the range of loads: the stall margin then has a resolution of 1/32."""

MINUS_3_DB = 1 / np.sqrt(2)
"""Amplitude ratio of -3 dB."""


def measured(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    """Return the requirement's measure of `actuator` under each of the fault `vectors` (n, 8), shape (n,).

    Units and definitions are those of `Requirement`. A step that does not settle within its duration has an
    infinite settling time; a bandwidth or stall margin outside the computed range is set to the end of it.

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
    compute_measure = partial(by_name[str(requirement.measure)], actuator, requirement)
    samples = requirement.duration / _interval(actuator, requirement)
    at_once = int(np.clip(BATCH_SAMPLES / samples, 1, BATCH))
    return np.concatenate(
        [compute_measure(vectors[i : i + at_once]) for i in range(0, len(vectors), at_once)]
    )


def _interval(actuator: Actuator, requirement: Requirement) -> float:
    """Return the time between the samples of the requirement's manoeuvre [s].

    The current is sampled at each step of the model: its peak after a step command lasts less than 1 ms.
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
    # Rounded, so that a limit of 0.022 s is equal to 44 samples.
    times = np.where(outside.any(axis=1), np.round(settled * INTERVAL, 9), 0.0)
    return np.asarray(np.where(outside[:, -1], np.inf, times))


def _bandwidth(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    """Return the bandwidth (n,) [Hz], from the amplitude ratio interpolated over the log frequency."""
    frequencies = np.geomspace(LOWEST_HZ, requirement.frequency_hz or HIGHEST_HZ, FREQUENCIES)
    gains = np.stack([_gain(actuator, requirement, vectors, float(f)) for f in frequencies], axis=1)
    below = gains < MINUS_3_DB
    first = np.argmax(below, axis=1)
    bandwidth = np.where(below.any(axis=1), frequencies[0], frequencies[-1])
    for i in np.unique(first[first > 0]):
        rows = np.flatnonzero(first == i)
        refined = np.geomspace(frequencies[i - 1], frequencies[i], REFINED + 1)
        refined_gains = [_gain(actuator, requirement, vectors[rows], float(f)) for f in refined[1:-1]]
        bandwidth[rows] = _frequency_at_minus_3_db(
            refined, np.stack([gains[rows, i - 1], *refined_gains, gains[rows, i]], axis=1)
        )
    return np.asarray(bandwidth)


def _frequency_at_minus_3_db(frequencies: Array, gains: Array) -> Array:
    """Return the frequencies (n,) at which amplitude ratios (n, m) at `frequencies` (m,) fall to -3 dB."""
    first = np.argmax(gains < MINUS_3_DB, axis=1)
    rows, before = np.arange(len(gains)), first - 1
    high, low = gains[rows, before], gains[rows, first]
    share = (high - MINUS_3_DB) / (high - low)
    return np.asarray(frequencies[before] * (frequencies[first] / frequencies[before]) ** share)


def _gain(actuator: Actuator, requirement: Requirement, vectors: Array, frequency: float) -> Array:
    sine, plant = Sine(requirement.amplitude, frequency), Plant.of(actuator, vectors)
    interval = 1 / frequency / PERIOD_SAMPLES
    time, signals = _run(actuator, plant, requirement, sine, PERIODS / frequency, interval)
    phasor = np.exp(-2j * np.pi * frequency * time[-PERIOD_SAMPLES:])
    component = signals["position_rad"][:, -PERIOD_SAMPLES:] @ phasor * 2 / PERIOD_SAMPLES
    return np.asarray(np.abs(component) / requirement.amplitude)


def _stall_margin(actuator: Actuator, requirement: Requirement, vectors: Array) -> Array:
    """Return the stall margin (n,) by bisection: the largest load with the position within `amplitude`.

    The load rises over the first half of the duration; the position is evaluated in the second half, in which
    the load is constant. A load is also held if the shaft slips from a weak phase to the next and rests
    there.
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
    """Return the times (samples,) and the channels, (n, samples) each; positions are relative to the start.

    A manoeuvre starts at 0, or in the middle of the travel if an end stop is nearer than its amplitude.
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
