"""What a model of the actuator is, to those who run it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from emaphm.arrays import Array
from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.plant import Plant

OBSERVABLE = ("current_A", "voltage_V", "position_rad", "speed_rad_s")
"""The first channels of every model: what a rig may record and a fit compare."""

ENTRY = "advance"
"""Name of the function in the object file of every kernel."""


class Layout(NamedTuple):
    """What a kernel is compiled for."""

    lanes: int
    """Actuators that it advances together."""
    channels: int
    """How many of the model's channels are recorded, from the first on: 1, those of `OBSERVABLE`, or all."""


@dataclass(frozen=True)
class Initial:
    """Where a run starts: motor angle [rad], motor speed [rad/s], and the rotor's electrical zero.

    `angle` is gear-wise: user position / gear ratio. The rotor's absolute mechanical angle, which
    commutation and eccentricity depend on, is angle + rotor_offset [rad].
    """

    angle: float = 0.0
    speed: float = 0.0
    rotor_offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Model:
    """A model of the actuator: how to build its kernel, parameters and initial state.

    Two models are equal only if they are one: kernels are looked up by it in every run.

    Attributes
    ----------
    step
        Integration step [s].
    channels
        What a single run records. A batch records the first, the equivalent current, or `OBSERVABLE`.
    switches
        Whether it switches the supply voltage, which takes windings.
    parameters
        From plants (n) and the step [s] to the kernel's parameters, shape (rows, n).
    initial_state
        From plants (n), inputs and the start to the kernel's state, shape (rows, n).
    build
        From a layout to the kernel as a Python function that Numba can compile; `compilation` has its
        arguments.
    """

    name: str
    step: float
    channels: tuple[str, ...]
    switches: bool
    parameters: Callable[[Plant, float], Array]
    initial_state: Callable[[Plant, Inputs, Initial], Array]
    build: Callable[[Layout], Callable[..., None]]
