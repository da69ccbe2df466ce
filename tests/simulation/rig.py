"""Helpers to run a model in a test."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from emaphm.actuator import Actuator, Command, Faults, Load, Step
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, OBSERVABLE, Initial, Inputs, Model, Plant, observe_batch, run
from emaphm.simulation.engine.step_tracing import StepInputs
from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.models import motion

THESIS = Actuator.thesis()
INTERVAL = 2e-4
"""Interval of the acquisition of docs/physics.md, section 7 [s]: 5 kHz."""

SHORTED = np.array([1.0, 1.0, 0.7, 0.7, 0.7, 1.0, 1.0, 1.0])
"""Upper limits of the faults in the range of the averaged model (docs/physics.md, section 5)."""


def altered(actuator: Actuator = THESIS, /, **sections: dict[str, Any] | None) -> Actuator:
    """Return `actuator` with the given keys of its sections set; a section given as None is dropped."""
    values = actuator.model_dump()
    for name, keys in sections.items():
        if keys is None:
            del values[name]
        else:
            values[name] = (values[name] or {}) | keys
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
"""Mechanics without friction and end stops."""

LOCKED = {"static_friction_motor": 1e3}
"""Mechanics that any torque of the motor leaves at rest."""

SERVO: dict[str, dict[str, Any]] = {
    "controller": {
        "position_gain": 1.0,
        "speed_gain": 1.0,
        "speed_limit": None,
        "speed_feedback": 0.0,
        "torque_constant": None,
    },
    "motor": {"torque_limit": None},
}
"""Sections for a drive of kind `voltage`, whose duty cycle is then the position error in rad."""


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
    """Return all channels of one run, and its time; `options` as for `Inputs.of`."""
    samples = round(duration / interval)
    inputs = Inputs.of(command, load, samples=samples, interval=interval, step=step or model.step, **options)
    plant = Plant.of(actuator, (faults or Faults()).vector)
    return {"time_s": inputs.time_s, **run(model, plant, inputs, start or Initial())}


def currents(model: Model, plant: Plant, inputs: Inputs) -> Array:
    """Return the equivalent currents [A] of all actuators in `plant`, shape (n, samples)."""
    return observe_batch(model, plant, inputs, channels=OBSERVABLE[:1])[:, 0]


def errors_of_a_dc_motor(
    actuator: Actuator, duty: float, slopes: Callable[..., list[float]], duration: float
) -> tuple[float, float]:
    """Return the largest errors of the current [A] at steps of 20 and 5 µs, from rest with a duty cycle.

    The reference integrates `slopes`, a function of time and (current, speed), with a tight tolerance.
    """

    def error(step: float) -> float:
        signals = record(
            AVERAGED,
            Step(duty),
            actuator,
            duration=duration,
            interval=5e-4,
            step=step,
            sampling="instant",
        )
        times = signals["time_s"] + step  # at the end of a step
        exact = solve_ivp(slopes, (0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-9).y
        return float(np.abs(signals["current_A"] - exact[0]).max())

    return error(2e-5), error(5e-6)


class Shaft:
    """The law of motion stepped in Python: parameters by name, with a default of 0 or no limit."""

    def __init__(self, step: float, structure: Structure = Structure(), **parameters: float) -> None:  # noqa: B008
        names = motion.parameter_names(structure)
        known = {"gear_ratio": 1.0, "low_stop": -1e9, "high_stop": 1e9, "pole_pairs": 1.0} | parameters
        self.step = step
        self.state = dict.fromkeys(motion.state_names(structure), 0.0) | {"cos": 1.0}
        self._parameters = SimpleNamespace(**{name: known.get(name, 0.0) for name in names})
        self._moved = motion.motion(structure)

    def move(self, torque: float, load: float = 0.0) -> None:
        """Take one step with the torque of the motor and a load [N·m]."""
        inputs = StepInputs(0.0, load, 0.0, 1.0, 0.0, self.step, 1.0)
        following = self._moved(SimpleNamespace(**self.state), self._parameters, inputs, torque)
        self.state = dict(zip(self.state, map(float, following), strict=True))


def rms(values: ArrayLike) -> Any:
    """Return the root of the mean square along the last axis."""
    return np.sqrt(np.mean(np.square(values), axis=-1))


class WindingEnergies(NamedTuple):
    """Energies of three windings over a run [J]: supplied, lost in the copper, to the shaft, and stored."""

    supplied: float
    joule: float
    shaft: float
    magnetic: float

    @property
    def error(self) -> float:
        """Absolute error of the balance, relative to the supplied energy."""
        return abs(self.supplied - self.joule - self.shaft - self.magnetic) / self.supplied


def winding_energies(
    signals: dict[str, Array], faults: Faults, resistance: float, inductance: float, interval: float
) -> WindingEnergies:
    """Return the energies of `signals`, one row per `interval` [s], by line resistance and inductance.

    Currents and speeds are evaluated at the middle of each step, so that only second orders remain.
    """
    turns = np.array([1 - faults.short_a, 1 - faults.short_b, 1 - faults.short_c])[:, None]
    after = np.stack([signals[f"current_{phase}_A"] for phase in "abc"])
    middle = (np.pad(after, ((0, 0), (1, 0)))[:, :-1] + after) / 2
    legs = np.stack([signals[f"voltage_{phase}_V"] for phase in "abc"])
    speed = signals["speed_rad_s"]
    return WindingEnergies(
        supplied=np.sum(legs * middle) * interval,
        joule=np.sum(resistance / 2 * turns * middle**2) * interval,
        shaft=np.sum(signals["torque_Nm"] * (speed + np.pad(speed, (1, 0))[:-1]) / 2) * interval,
        magnetic=np.sum(inductance / 4 * turns[:, 0] ** 2 * after[:, -1] ** 2),
    )
