"""Running a model: one actuator with every signal, or many with their equivalent currents."""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import ArrayLike

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.kernels import LANES, OBSERVABLE, Initial, Model, kernel
from emaphm.simulation.engine.plant import Plant

WORTH_A_THREAD = 200_000
"""Group-steps (about 10 ms) below which starting threads costs more than it gains."""


def run(model: Model, plant: Plant, inputs: Inputs, start: Initial = Initial()) -> dict[str, Array]:  # noqa: B008
    """Return every channel of `model` for the single actuator in `plant`, each of shape (samples,).

    Raises
    ------
    MethodError
        There is not exactly one actuator, its windings are not described and the model needs them, or
        the simulation did not stay finite.
    """
    if plant.count != 1:
        raise MethodError(f"a single run takes one actuator, got {plant.count}; use run_batch")
    out = np.empty((len(model.channels), inputs.samples, 1))
    _advance(model, plant, inputs, start, out)
    _check_finite(model, out)
    return {name: out[i, :, 0] for i, name in enumerate(model.channels)}


def run_batch(
    model: Model,
    plant: Plant,
    inputs: Inputs,
    start: Initial = Initial(),  # noqa: B008
    *,
    workers: int | None = None,
) -> Array:
    """Return the sampled equivalent currents [A] of all actuators in `plant`, shape (n, samples).

    Groups of `LANES` actuators run in `workers` threads (default: one a core); the result does not
    depend on their number, bit for bit.

    Raises
    ------
    MethodError
        The actuators' windings are not described and the model needs them, or a simulation did not stay
        finite.
    """
    return _batch(model, plant, inputs, start, OBSERVABLE[:1], workers)[:, 0]


def observe_batch(
    model: Model,
    plant: Plant,
    inputs: Inputs,
    start: Initial = Initial(),  # noqa: B008
    *,
    channels: Sequence[str] = OBSERVABLE,
    workers: int | None = None,
) -> Array:
    """Return `channels`, some of `OBSERVABLE`, of all actuators in `plant`: (n, channels, samples)."""
    return _batch(model, plant, inputs, start, channels, workers)


def _batch(
    model: Model, plant: Plant, inputs: Inputs, start: Initial, names: Sequence[str], workers: int | None
) -> Array:
    rows = [OBSERVABLE.index(name) for name in names]
    channels = 1 if rows == [0] else len(OBSERVABLE)
    padded = plant.padded(LANES)
    out = np.empty((padded.count // LANES, channels, inputs.samples, LANES))
    groups = [padded.part(first, first + LANES) for first in range(0, padded.count, LANES)]
    workers = min(workers or os.cpu_count() or 1, len(groups))
    if len(groups) * inputs.command.size < WORTH_A_THREAD:
        workers = 1

    def advance(i: int) -> None:
        _advance(model, groups[i], inputs, start, out[i])

    if workers <= 1:
        for i in range(len(groups)):
            advance(i)
    else:
        kernel(model, LANES, channels)  # compile once, before the threads
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(advance, range(len(groups))))
    _check_finite(model, out)
    by_actuator = np.empty((padded.count // LANES, LANES, len(rows), inputs.samples))
    for i, row in enumerate(rows):
        by_actuator[:, :, i] = out[:, row].transpose(0, 2, 1)
    return by_actuator.reshape(padded.count, len(rows), inputs.samples)[: plant.count]


def simulate_batch(
    model: Model,
    actuator: Actuator,
    faults: ArrayLike,
    inputs: Inputs,
    start: Initial = Initial(),  # noqa: B008
    *,
    workers: int | None = None,
) -> Array:
    """Return the equivalent currents [A] of `actuator` under each of `faults` (n, 8), shape (n, samples)."""
    return run_batch(model, Plant.of(actuator, faults), inputs, start, workers=workers)


def _advance(model: Model, plant: Plant, inputs: Inputs, start: Initial, out: Array) -> None:
    if model.switches and not plant.has_windings:
        raise MethodError(
            f"the {model.name} model switches the windings' voltage, which needs an [electrical] section; "
            "add one to the actuator, or use the averaged model"
        )
    step = inputs.step
    x = model.initial_state(plant, inputs, start).ravel()
    p = model.parameters(plant, step).ravel()
    advance = kernel(model, plant.count, len(out))
    advance(
        x,
        p,
        inputs.command,
        inputs.load,
        inputs.noise,
        step,
        inputs.substeps,
        inputs.window,
        float(inputs.sampling == "mean"),
        out,
    )


def _check_finite(model: Model, out: Array) -> None:
    if not np.all(np.isfinite(out)):
        raise MethodError(
            f"the {model.name} model did not stay finite; "
            "check the actuator's inertia, inductance and gains, or shorten the step"
        )
