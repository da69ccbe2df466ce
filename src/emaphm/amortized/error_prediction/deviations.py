"""Deviations that the training set lacks: sensor errors, and differences from the description.

A network that was trained on simulations without deviations infers faults from a delayed sensor. The error
predictor is therefore trained on these deviations: a delay, a scale error and a zero error of each sensor; a
common delay of all sensors; another inertia; and a dry friction that passes smoothly through standstill (the
laws "stribeck" and "transition", with the strengths that they have before a calibration).
"""

from dataclasses import dataclass

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.laws import law_named
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import TrainingSet, block_of, simulated
from emaphm.arrays import Array, Single
from emaphm.estimation.signal_size import row_sizes
from emaphm.simulation import AVERAGED, Inputs


@dataclass(frozen=True)
class DeviationSettings:
    """Probabilities and sizes of the deviations; sizes are uniform on a logarithmic scale.

    Four in ten training recordings have no deviation, four in ten have one.

    Delays of either sign are within `rows`: a common delay of all sensors with probability `often`, one of
    each sensor with `seldom`. Relative errors of scales and of the inertia are within `relative`, each with
    `often`; zero errors are within `relative` of the channel's rms, with `seldom`. The effect of a smooth
    friction is multiplied by a factor within `smooth`, with `seldom`.
    """

    rows: tuple[float, float] = (0.3, 5.0)
    relative: tuple[float, float] = (0.01, 0.2)
    smooth: tuple[float, float] = (0.1, 1.0)
    often: float = 0.15
    seldom: float = 0.06


DEVIATIONS = DeviationSettings()

SMOOTH = ("stribeck", "transition")
"""Laws of a smooth friction."""

INERTIA_STEP = 0.05
"""Relative change of the inertia in the runs of `other_descriptions`."""

OTHER_RUNS = 2
"""Number of runs that `other_descriptions` returns for each point."""

ALL_LATE = OTHER_RUNS
"""Index of the common delay of all channels in `deviation_directions`."""


def smooth_friction(actuator: Actuator) -> Actuator:
    """Return `actuator` with a smooth friction; unchanged if its description has one."""
    for name in SMOOTH:
        actuator = law_named(name).added_to(actuator)
    return actuator


def other_descriptions(setup: RecordingSetup, inputs: Inputs, points: Array) -> Single:
    """Return rows (n, 2, channels, blocks) of the averaged model with other descriptions, at points (n, d).

    The first description has an inertia that is larger by `INERTIA_STEP`, the second a smooth friction.
    """
    heavier = simulated(setup, inputs, AVERAGED, points, inertia=np.full(len(points), INERTIA_STEP))
    smooth = simulated(setup, inputs, AVERAGED, points, actuator=smooth_friction(setup.actuator))
    return np.stack([heavier, smooth], axis=1)


def deviation_directions(modelled: Single, others: Single) -> Single:
    """Return the change of the rows by a unit of each deviation, (n, m, channels, blocks).

    `modelled` (n, channels, blocks) are rows of the averaged model, `others` those of `other_descriptions`;
    m is `deviation_count`.
    """
    channels = modelled.shape[1]
    derivative = np.gradient(modelled, axis=-1)
    directions = [others - modelled[:, np.newaxis]]
    if channels > 1:
        directions.append(derivative[:, np.newaxis])
    for values in (derivative, modelled, np.ones_like(modelled)):
        by_channel = np.zeros((len(values), channels, *values.shape[1:]), np.float32)
        for i in range(channels):
            by_channel[:, i, i] = values[:, i]
        directions.append(by_channel)
    return np.concatenate(directions, axis=1)


def deviation_count(channels: int) -> int:
    """Return the number of deviations for recordings with this number of channels."""
    return OTHER_RUNS + 3 * channels + (channels > 1)


def deviating(
    setup: RecordingSetup,
    inputs: Inputs,
    draws: TrainingSet,
    rng: np.random.Generator,
    settings: DeviationSettings = DEVIATIONS,
) -> TrainingSet:
    """Return noise-free `draws` with random deviations, drawn with `rng`.

    The effects of another inertia and another friction on the rows are those on the averaged model's run.
    """
    n, channels = len(draws), len(setup.channels)
    often, seldom = settings.often, settings.seldom

    def drawn(span: tuple[float, float], chance: float, count: int) -> Array:
        low, high = span
        size = low * (high / low) ** rng.random((n, count)) * rng.choice([-1.0, 1.0], (n, count))
        return np.asarray(np.where(rng.random((n, count)) < chance, size, 0.0))

    rows = draws.rows.astype(float)
    points = draws.points.astype(float)
    as_described = simulated(setup, inputs, AVERAGED, points)
    inertia = drawn(settings.relative, often, 1)[:, 0]
    rows += simulated(setup, inputs, AVERAGED, points, inertia=inertia) - as_described
    smooth = np.abs(drawn(settings.smooth, seldom, 1))[:, :, np.newaxis]
    rows += smooth * (
        simulated(setup, inputs, AVERAGED, points, actuator=smooth_friction(setup.actuator)) - as_described
    )
    delays = drawn(settings.rows, often, 1) + drawn(settings.rows, seldom, channels)
    rows = delayed(rows, delays / block_of(setup.samples))
    sizes = row_sizes(setup.channels, rows)[..., np.newaxis]
    rows = rows * (1 + drawn(settings.relative, often, channels)[:, :, np.newaxis])
    rows += sizes * drawn(settings.relative, seldom, channels)[:, :, np.newaxis]
    return TrainingSet(draws.points, rows.astype(np.float32))


def delayed(rows: Array, blocks: Array) -> Array:
    """Return rows (n, channels, blocks) delayed by `blocks` (n, channels); the end values are held.

    Values between two blocks are interpolated by the cubic of Catmull and Rom (1974), which smooths less than
    a straight line.
    """
    last = rows.shape[-1] - 1
    times = np.arange(last + 1) - blocks[..., np.newaxis]
    before = np.floor(times)
    part = times - before
    a, b, c, d = (
        np.take_along_axis(rows, np.clip(before + k, 0, last).astype(int), axis=-1) for k in (-1, 0, 1, 2)
    )
    cubic = c - a + part * (2 * a - 5 * b + 4 * c - d + part * (3 * (b - c) + d - a))
    return np.asarray(b + 0.5 * part * cubic)
