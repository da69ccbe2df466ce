"""What a model of the actuator is, to those who run it."""

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
"""The first channels of every form of a model: what a rig may record and a fit compare."""

LARGEST_PHASE = 0.7
"""Phase by which a shaft may swing in a step [rad]: its frequency is then right to 2 %, phase² / 24."""

SHORTEST_SHARE = 0.25
"""Least share of a model's step: a shaft that swings faster still is as good as rigid."""

ENTRY = "advance"
"""Name of the function in the object file of every kernel."""

CACHE_LINE = 64
"""Bytes; also those of the widest vector."""


class Layout(NamedTuple):
    """What a kernel is compiled for."""

    lanes: int
    """Actuators that it advances together."""
    channels: int
    """How many of the model's channels are recorded, from the first on: the others take no time."""
    structure: Structure = Structure()
    """Drive and optional laws."""
    known: tuple[tuple[str, float], ...] = ()
    """Parameters, and inputs of every step, that have one value throughout, and what it is."""


@dataclass(frozen=True)
class Initial:
    """Where a run starts: user, motor speed [rad/s], the rotor's electrical zero, and the backlash gap.

    `angle` is the user's, gear-wise: user position / gear ratio [rad]. The motor is ahead of it by the share
    `gap` of half of the backlash: 1 where it carries the user up, -1 down, 0 in the middle. The rotor's
    absolute mechanical angle, which commutation and eccentricity depend on, is the motor's + rotor_offset.
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
        What a single run records. A batch records the first, or those that are `observable`.
    observable
        The first of the channels: those that a rig may record and a fit compare.
    parameters
        From plants (n) and the step [s] to the kernel's parameters by name, (n,) each.
    initial_state
        From plants (n), inputs and the start to the kernel's state by name, (n,) each; it may name more than
        the kernel has.
    state_names, parameter_names
        From a structure to the kernel's rows, in their order.
    advance
        From a structure to the step of one actuator, as `step_tracing` takes it.
    neutral
        By name of a parameter, the value at which a term of the equations vanishes. Where all actuators of a
        run have that value, their kernel is compiled without the term.
    longest_step
        Longest integration step [s], that of the model where left out.
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

    Two models are equal only if they are one: kernels are looked up by it in every run.

    Attributes
    ----------
    step
        Longest integration step [s].
    forms
        By kind of drive; a drive that is missing is one that the model does not know.
    switches
        Whether it switches the supply voltage, so that its outputs have no useful derivatives.
    """

    name: str
    step: float
    forms: Mapping[str, Form]
    switches: bool = False

    def step_for(self, actuator: Actuator) -> float:
        """Return the longest integration step [s] for `actuator`: shorter where its shaft swings fast."""
        form = self.forms.get(actuator.drive_kind)
        longest = self.step if form is None or form.longest_step is None else form.longest_step
        if actuator.transmission is None:
            return longest
        m = actuator.mechanics
        reduced = m.inertia_motor * m.inertia_user / m.inertia
        swinging = LARGEST_PHASE * math.sqrt(reduced / actuator.transmission.stiffness)
        return min(longest, max(swinging, longest * SHORTEST_SHARE))

    def form(self, structure: Structure) -> Form:
        """Return the form for the drive of `structure`.

        Raises
        ------
        MethodError
            The model has none for that drive.
        """
        if structure.drive not in self.forms:
            raise MethodError(
                f"the {self.name} model has no drive of kind '{structure.drive}'; it has "
                f"{', '.join(self.forms)}: describe the drive, or use the averaged model"
            )
        return self.forms[structure.drive]
