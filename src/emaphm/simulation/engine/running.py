"""Execution of a model: one actuator with all channels, or a batch of actuators with selected channels."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.errors import DivergedError, MethodError
from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.kernel_cache import Kernel, kernel
from emaphm.simulation.engine.model import CACHE_LINE, OBSERVABLE, Form, Initial, Layout, Model
from emaphm.simulation.engine.plant import Plant
from emaphm.threads import in_threads

LANES = 16
"""Number of actuators that a batch kernel advances together: two AVX-512 or four AVX2 registers."""

WORTH_A_THREAD = 200_000
"""Number of group-steps (about 10 ms) below which threads take longer to start than they save."""


def run(model: Model, plant: Plant, inputs: Inputs, start: Initial = Initial()) -> dict[str, Array]:  # noqa: B008
    """Return every channel of `model` for the single actuator in `plant`, each of shape (samples,).

    Parameters
    ----------
    model
        From `emaphm.simulation.model_named`.
    plant
        One actuator, `Plant.of(actuator, faults)` with `faults` (8,).
    inputs
        Command, load and noise at every step.
    start
        Angle and speed of the motor at the start, and the offset of the rotor.

    Raises
    ------
    MethodError
        `plant` has not exactly one actuator, its windings are not described although the model needs them,
        or the simulation did not stay finite.
    """
    if plant.count != 1:
        raise MethodError(f"a single run takes one actuator, got {plant.count}; use observe_batch")
    names = model.form(plant.structure).channels
    advance, (block,) = _prepared(model, plant, inputs, start, 1, len(names))
    out = _output(1, 1, len(names), inputs.samples)[0]
    _advance(advance, block, out, inputs)
    _check_finite(model, out)
    return {name: out[0, i] for i, name in enumerate(names)}


def observe_batch(
    model: Model,
    plant: Plant,
    inputs: Inputs,
    start: Initial = Initial(),  # noqa: B008
    *,
    channels: Sequence[str] = OBSERVABLE,
    workers: int | None = None,
) -> Array:
    """Return `channels` of all actuators in `plant`, without sensor noise: (n, channels, samples).

    Groups of `LANES` actuators run in threads.

    Parameters
    ----------
    model
        From `emaphm.simulation.model_named`.
    plant
        n actuators, `Plant.of(actuator, faults)` with `faults` (n, 8).
    inputs
        Command, load and noise at every step, the same for all actuators.
    start
        Angle and speed of the motor at the start, and the offset of the rotor.
    channels
        Names of observable channels of the model: `OBSERVABLE`, and further channels of some drives.
    workers
        Number of threads, default one per core; the result has the same bits for any number.

    Raises
    ------
    MethodError
        The model does not support the actuators' drive, needs windings that are not described, or did not
        stay finite.
    """
    observable = model.form(plant.structure).observable
    rows = [observable.index(name) for name in channels]
    count = max(rows) + 1
    advance, blocks = _prepared(model, plant, inputs, start, LANES, count)
    groups = len(blocks)
    out = _output(groups, LANES, count, inputs.samples)
    if groups * inputs.command.size < WORTH_A_THREAD:
        workers = 1
    in_threads(lambda group: _advance(advance, *group, inputs), zip(blocks, out, strict=True), workers)
    by_actuator = out.reshape(groups * LANES, count, inputs.samples)[: plant.count]
    chosen = by_actuator if rows == list(range(count)) else by_actuator[:, rows]
    _check_finite(model, chosen)
    return chosen


def simulate_batch(
    model: Model,
    actuator: Actuator,
    faults: ArrayLike,
    inputs: Inputs,
    start: Initial = Initial(),  # noqa: B008
    *,
    workers: int | None = None,
) -> Array:
    """Return the equivalent currents [A] of `actuator` under each of `faults`, shape (n, samples).

    Parameters
    ----------
    model
        From `emaphm.simulation.model_named`, such as `model_named("averaged")`.
    actuator
        Description of the actuator.
    faults
        Normalised fault vectors, (n, 8).
    inputs, start, workers
        As in `emaphm.simulation.observe_batch`.

    Raises
    ------
    FaultError
        `faults` has another shape, or a value outside the range of the actuator.
    MethodError
        The model does not support the actuator's drive, or a run did not stay finite.
    """
    plant = Plant.of(actuator, faults)
    return observe_batch(model, plant, inputs, start, channels=OBSERVABLE[:1], workers=workers)[:, 0]


@dataclass(frozen=True, eq=False)
class _Block:
    """State (with the sums of the channels) and parameters of a group of actuators, each (rows × lanes,)."""

    state: Array
    parameters: Array


def _prepared(
    model: Model, plant: Plant, inputs: Inputs, start: Initial, lanes: int, channels: int
) -> tuple[Kernel, list[_Block]]:
    """Return the kernel for the plants, and the plants in groups of `lanes`.

    The last group is padded with copies of the last plant.
    """
    structure, form = plant.structure, model.form(plant.structure)
    state = form.initial_state(plant, inputs, start)
    parameters = form.parameters(plant, inputs.step)
    state_rows, parameter_rows = form.state_names(structure), form.parameter_names(structure)
    variables = len(state_rows) + channels
    rows = np.zeros((variables + len(parameter_rows), plant.count))
    rows[: len(state_rows)] = [state[name] for name in state_rows]
    rows[variables:] = [parameters[name] for name in parameter_rows]
    groups = -(-plant.count // lanes)
    padded = rows[:, np.minimum(np.arange(groups * lanes), plant.count - 1)]
    blocks = _aligned((groups, len(rows), lanes))
    blocks[:] = padded.reshape(len(rows), groups, lanes).transpose(1, 0, 2)
    layout = Layout(lanes, channels, structure, _known(form, parameters, inputs))
    return kernel(model, layout), [
        _Block(block[:variables].reshape(-1), block[variables:].reshape(-1)) for block in blocks
    ]


def _known(form: Form, parameters: Mapping[str, Array], inputs: Inputs) -> tuple[tuple[str, float], ...]:
    """Return names and values of the constants that are compiled into the kernel, see `Layout.known`."""
    known = {name: value for name, value in form.neutral.items() if (parameters[name] == value).all()}
    if inputs.enabled.strides == (0,) and inputs.enabled[0] == 1.0:
        known["enabled"] = 1.0
    # A mean uses the motion at the end of each step, an instant the motion at the start of the step.
    known["carried"] = float(inputs.sampling == "mean")
    return tuple(known.items())


def _aligned(shape: tuple[int, ...]) -> Array:
    """Return an array that starts on a cache line.

    A vector that spans two lines needs two accesses; kernels with aligned arrays are 5 % faster (measured).
    """
    size = math.prod(shape)
    memory = np.empty(size + CACHE_LINE // 8)
    first = -memory.ctypes.data % CACHE_LINE // 8
    return memory[first : first + size].reshape(shape)


def _output(groups: int, lanes: int, channels: int, samples: int) -> Array:
    """Return an array (groups, lanes, channels, samples) into which kernels write one column at a time.

    The distance of its rows is an odd number of cache lines, so that the entries of a column are in different
    sets of the processor's cache; with contiguous rows of 2560 samples the averaged model takes twice the
    time.
    """
    lines = -(-samples * 8 // CACHE_LINE) | 1
    return _aligned((groups, lanes, channels, lines * CACHE_LINE // 8))[..., :samples]


def _advance(advance: Kernel, block: _Block, out: Array, inputs: Inputs) -> None:
    command = np.ascontiguousarray(inputs.command)
    load, noise, enabled = inputs.load, inputs.noise, inputs.enabled
    advance(
        block.state.ctypes.data,
        block.parameters.ctypes.data,
        command.ctypes.data,
        load.ctypes.data,
        load.strides[0] // load.itemsize,
        noise.ctypes.data,
        noise.strides[0] // noise.itemsize,
        enabled.ctypes.data,
        enabled.strides[0] // enabled.itemsize,
        inputs.step,
        inputs.samples,
        inputs.substeps,
        inputs.window,
        out.ctypes.data,
        out.strides[-2] // out.itemsize,
    )


def _check_finite(model: Model, out: Array) -> None:
    if not np.all(np.isfinite(out)):
        raise DivergedError(
            f"the {model.name} model did not stay finite; "
            "check the actuator's inertia, inductance and gains, or shorten the step"
        )
