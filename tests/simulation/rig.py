"""Short ways to run a model in a test."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from emaphm.actuator import Actuator, Command, Faults, Load
from emaphm.arrays import Array
from emaphm.simulation import Initial, Inputs, Model, Plant, run

THESIS = Actuator.thesis()
INTERVAL = 2e-4
"""The acquisition of docs/physics.md, section 7: 5 kHz."""

SHORTED = np.array([1.0, 1.0, 0.7, 0.7, 0.7, 1.0, 1.0, 1.0])
"""Upper ends of the faults that the averaged model is meant for (docs/physics.md, section 5)."""


def altered(actuator: Actuator = THESIS, /, **sections: dict[str, Any] | None) -> Actuator:
    """Return `actuator` with the given keys of its sections set; a section given as None is dropped."""
    values = actuator.model_dump()
    for name, keys in sections.items():
        if keys is None:
            del values[name]
        else:
            values[name] |= keys
    return Actuator.from_dict(values)


FREE = {
    "viscous_motor": 0.0,
    "viscous_user": 0.0,
    "static_friction_motor": 0.0,
    "static_friction_user": 0.0,
    "dynamic_friction_motor": 0.0,
    "dynamic_friction_user": 0.0,
    "end_stops": None,
}
"""Mechanics that nothing brakes."""

LOCKED = {"static_friction_motor": 1e3}
"""Mechanics that stand still whatever the motor does."""


def record(
    model: Model,
    command: Command,
    actuator: Actuator = THESIS,
    *,
    faults: Faults | None = None,
    duration: float = 0.5,
    interval: float = INTERVAL,
    step: float | None = None,
    load: Load = 0.0,
    start: Initial | None = None,
    **options: Any,
) -> dict[str, Array]:
    """Return every channel of one run, and its time; `options` as for `Inputs.of`."""
    samples = round(duration / interval)
    inputs = Inputs.of(command, load, samples=samples, interval=interval, step=step or model.step, **options)
    plant = Plant.of(actuator, (faults or Faults()).vector)
    return {"time_s": inputs.time_s, **run(model, plant, inputs, start or Initial())}


def rms(values: ArrayLike) -> Any:
    """Return the root of the mean square along the last axis."""
    return np.sqrt(np.mean(np.square(values), axis=-1))
