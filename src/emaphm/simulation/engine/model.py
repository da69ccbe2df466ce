"""Definition of a model of the actuator: its forms by kind of drive, start values and kernel layout."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.structure import Structure

OBSERVABLE = ("current_A", "voltage_V", "position_rad", "speed_rad_s")
"""First channels of every form of a model: channels that a rig may record and a fit compares."""

LARGEST_PHASE = 0.7
"""Largest phase of a shaft's oscillation per step [rad]: the error of its frequency, phase² / 24, is 2 %."""

SHORTEST_SHARE = 0.25
"""Shortest step, relative to the model's step [-]: a shaft with a higher frequency is practically rigid."""

ENTRY = "advance"
"""Name of the function in the object file of every kernel."""

CACHE_LINE = 64
"""Size of a cache line and of the widest vector [bytes]."""


class Layout(NamedTuple):
    """Properties for which a kernel is compiled."""

    lanes: int
    """Number of actuators that the kernel advances together."""
    channels: int
    """Number of recorded channels, from the first; the kernel does not compute the others."""
    structure: Structure = Structure()
    """Kind of drive and optional laws."""
    known: tuple[tuple[str, float], ...] = ()
    """Names and values of parameters and inputs that are constant and equal for all actuators."""


@dataclass(frozen=True)
class Initial:
    """Start of a run: user angle [rad], motor speed [rad/s], rotor offset [rad] and position in the gap [-].

    `angle` is the position of the user divided by the gear ratio. The motor angle is `angle` plus `gap` times
    half of the backlash: `gap` is 1 if the motor pushes the user up, -1 if it pushes down, 0 in the middle.
    The rotor's absolute mechanical angle, on which commutation and eccentricity depend, is the motor angle
    plus `rotor_offset`.
    """

    angle: float = 0.0
    speed: float = 0.0
    rotor_offset: float = 0.0
    gap: float = 0.0


@dataclass(frozen=True, eq=False)
class Form:
    """A model's form for one kind of drive.

    Attributes
    ----------
    channels
        Channels that a single run records. A batch records some or all of the `observable` channels.
    observable
        First of the channels: channels that a rig may record and a fit compares.
    parameters
        Function of plants (n) and the step [s]; returns the kernel's parameters by name, (n,) each.
    initial_state
        Function of plants (n), inputs and the start; returns the kernel's state by name, (n,) each. It may
        contain more names than the kernel uses.
    state_names, parameter_names
        Functions of a structure; return the names of the kernel's rows in their order.
    advance
        Function of a structure; returns the step of one actuator in the form of `step_tracing.traced`.
    neutral
        By name of a parameter, the value at which a term of the equations vanishes. If all actuators of a run
        have that value, their kernel is compiled without the term.
    longest_step
        Longest integration step [s]; the step of the model if None.
    """

    channels: tuple[str, ...]
    observable: tuple[str, ...]
    parameters: Callable[[Plant, float], Mapping[str, Array]]
    initial_state: Callable[[Plant, Inputs, Initial], Mapping[str, Array]]
    state_names: Callable[[Structure], tuple[str, ...]]
    parameter_names: Callable[[Structure], tuple[str, ...]]
    advance: Callable[[Structure], Callable[..., Any]]
    neutral: Mapping[str, float]
    longest_step: float | None = None


@dataclass(frozen=True, eq=False)
class Model:
    """A model of the actuator: its form for each kind of drive.

    Models are compared by identity, because every run looks up its kernel by the model.

    Attributes
    ----------
    step
        Longest integration step [s].
    forms
        Forms by kind of drive; the model does not support other drives.
    switches
        Whether the model switches the supply voltage, so that its outputs have no useful derivatives.
    """

    name: str
    step: float
    forms: Mapping[str, Form]
    switches: bool = False

    def step_for(self, actuator: Actuator) -> float:
        """Return the longest integration step [s] for `actuator`; shorter if its shaft oscillates fast."""
        form = self.forms.get(actuator.drive_kind)
        longest = self.step if form is None or form.longest_step is None else form.longest_step
        if actuator.transmission is None:
            return longest
        m = actuator.mechanics
        reduced = m.inertia_motor * m.inertia_user / m.inertia
        oscillation_limit = LARGEST_PHASE * math.sqrt(reduced / actuator.transmission.stiffness)
        return min(longest, max(oscillation_limit, longest * SHORTEST_SHARE))

    def form(self, structure: Structure) -> Form:
        """Return the form for the drive of `structure`.

        Raises
        ------
        MethodError
            The model has no form for that drive.
        """
        if structure.drive not in self.forms:
            raise MethodError(
                f"the {self.name} model has no drive of kind '{structure.drive}'; it has "
                f"{', '.join(self.forms)}: describe the drive, or use the averaged model"
            )
        return self.forms[structure.drive]
