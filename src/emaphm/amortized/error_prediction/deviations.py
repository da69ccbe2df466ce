"""What a recording may have and no simulation has: sensors that err, an actuator not as described.

A network that has seen faithful recordings alone takes up a late sensor as faults. Here are the deviations
that the error predictor is trained on: of each sensor a delay, another scale and another zero; a delay of all
sensors together; another inertia; and a dry friction that passes smoothly through standstill (the laws
"stribeck" and "transition", as strong as the library assumes them before a calibration).
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
    """How often training recordings deviate, and by how much; sizes are even on a logarithmic scale.

    Four in ten do not deviate, four in ten in one respect.

    Sensors come `rows` late or early, all together `often`, each by itself `seldom`. Scales and inertia are
    off by `relative`, each `often`; zeros by `relative` of the channel's rms, `seldom`. Of the difference
    that a smooth friction makes, `smooth` is there, `seldom`.
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
"""Relative change of the inertia that `other_descriptions` runs with."""

OTHERS = 2
"""Runs that `other_descriptions` returns for each point."""

ALL_LATE = OTHERS
"""Place of the delay of all channels among `deviation_directions`."""


def smooth_friction(actuator: Actuator) -> Actuator:
    """Return `actuator` with a smooth friction; as it is where its description has one."""
    for name in SMOOTH:
        actuator = law_named(name).added_to(actuator)
    return actuator


def other_descriptions(setup: RecordingSetup, inputs: Inputs, points: Array) -> Single:
    """Return rows of the averaged model at points (n, d), (n, 2, channels, blocks).

    With an inertia that is larger by `INERTIA_STEP`, and with a smooth friction.
    """
    heavier = simulated(setup, inputs, AVERAGED, points, inertia=np.full(len(points), INERTIA_STEP))
    smooth = simulated(setup, inputs, AVERAGED, points, actuator=smooth_friction(setup.actuator))
    return np.stack([heavier, smooth], axis=1)


def deviation_directions(modelled: Single, others: Single) -> Single:
    """Return what a unit of each deviation would add to rows, (n, m, channels, blocks); m: `deviation_count`.

    To the averaged model's `modelled` (n, channels, blocks); `others` are as from `other_descriptions`.
    """
    channels = modelled.shape[1]
    late = np.gradient(modelled, axis=-1)
    found = [others - modelled[:, np.newaxis]]
    if channels > 1:
        found.append(late[:, np.newaxis])
    for values in (late, modelled, np.ones_like(modelled)):
        of_one = np.zeros((len(values), channels, *values.shape[1:]), np.float32)
        for i in range(channels):
            of_one[:, i, i] = values[:, i]
        found.append(of_one)
    return np.concatenate(found, axis=1)


def deviation_count(channels: int) -> int:
    """Return how many deviations are known of recordings with this number of channels."""
    return OTHERS + 3 * channels + (channels > 1)


def deviating(
    setup: RecordingSetup,
    inputs: Inputs,
    draws: TrainingSet,
    rng: np.random.Generator,
    settings: DeviationSettings = DEVIATIONS,
) -> TrainingSet:
    """Return noise-free draws as they would have been recorded with deviations, of most of them several.

    Another inertia and another friction change a recording by what they change of the averaged model's run.
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
    late = drawn(settings.rows, often, 1) + drawn(settings.rows, seldom, channels)
    rows = later(rows, late / block_of(setup.samples))
    sizes = row_sizes(setup.channels, rows)[..., np.newaxis]
    rows = rows * (1 + drawn(settings.relative, often, channels)[:, :, np.newaxis])
    rows += sizes * drawn(settings.relative, seldom, channels)[:, :, np.newaxis]
    return TrainingSet(draws.points, rows.astype(np.float32))


def later(rows: Array, blocks: Array) -> Array:
    """Return rows (n, channels, blocks) that come `blocks` (n, channels) later; the end values are held.

    Between two blocks by the cubic of Catmull and Rom (1974), which smooths less than a straight line.
    """
    last = rows.shape[-1] - 1
    at = np.arange(last + 1) - blocks[..., np.newaxis]
    before = np.floor(at)
    part = at - before
    a, b, c, d = (
        np.take_along_axis(rows, np.clip(before + k, 0, last).astype(int), axis=-1) for k in (-1, 0, 1, 2)
    )
    cubic = c - a + part * (2 * a - 5 * b + 4 * c - d + part * (3 * (b - c) + d - a))
    return np.asarray(b + 0.5 * part * cubic)
