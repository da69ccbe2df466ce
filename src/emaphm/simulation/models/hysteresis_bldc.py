"""A BLDC motor with three switched phases: hysteresis control of each current (thesis 3.1, chapter 4)."""

from collections.abc import Callable
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.model import OBSERVABLE, Form, Initial
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.angles import phase_angles
from emaphm.simulation.laws.commutation import demand_sign, trapezoid
from emaphm.simulation.laws.eccentricity import gap_factors
from emaphm.simulation.laws.inline import clip, law
from emaphm.simulation.laws.inverter import switch
from emaphm.simulation.laws.lag import approach, share_of_step
from emaphm.simulation.laws.star_windings import star_slopes
from emaphm.simulation.laws.supply_source import sagging_supply
from emaphm.simulation.models import control, motion

CHANNELS = (
    "current_A",
    "voltage_V",
    "position_rad",
    "speed_rad_s",
    "angle_rad",
    "torque_Nm",
    "reference_current_A",
    "current_a_A",
    "current_b_A",
    "current_c_A",
    "current_active_A",
    "current_magnitude_A",
    "voltage_a_V",
    "voltage_b_V",
    "voltage_c_V",
)

PARAMETERS = (
    "hysteresis",
    "half_supply",
    "resistance_a",
    "resistance_b",
    "resistance_c",
    "step_per_henry_a",
    "step_per_henry_b",
    "step_per_henry_c",
    "henries_per_step",
    "flux_a",
    "flux_b",
    "flux_c",
    "z_cos",
    "z_sin",
    "source_resistance",
    "sensed_share",
)


def parameters(plant: Plant, step: float) -> dict[str, Array]:
    """Return the kernel's parameters for `plant` at `step` [s], (n,) each."""
    per_henry = step / (plant.inductance / 2 * plant.turns**2)
    rows = {
        "hysteresis": plant.hysteresis,
        "half_supply": plant.supply / 2,
        "henries_per_step": 1 / per_henry.sum(axis=0),
        "z_cos": plant.z[0],
        "z_sin": plant.z[1],
        "source_resistance": plant.source_resistance,
        "sensed_share": share_of_step(plant.current_lag, step),
    }
    for i, phase in enumerate("abc"):
        rows |= {
            f"resistance_{phase}": plant.resistance / 2 * plant.turns[i],
            f"step_per_henry_{phase}": per_henry[i],
            f"flux_{phase}": plant.torque_constant / 2 * plant.turns[i],
        }
    return control.parameters(plant, step) | motion.parameters(plant, step) | rows


def initial_state(plant: Plant, inputs: Inputs, start: Initial) -> dict[str, Array]:
    """Return the kernel's state at `start`, (n,) each: no current, all legs low."""
    zero = np.zeros(plant.count)
    own = {
        "torque": zero,
        **{f"current_{phase}": zero for phase in "abc"},
        **{f"leg_{phase}": zero - 1.0 for phase in "abc"},
        "bus_current": zero,
        **{f"sensed_{phase}": zero for phase in "abc"},
    }
    return control.initial_state(plant, inputs, start) | motion.initial_state(plant, start) | own


def state_names(structure: Structure) -> tuple[str, ...]:
    """Return the kernel's state."""
    return (
        *control.state_names(structure),
        *motion.state_names(structure),
        "torque",
        "current_a",
        "current_b",
        "current_c",
        "leg_a",
        "leg_b",
        "leg_c",
        *(("bus_current",) if structure.source else ()),
        *(("sensed_a", "sensed_b", "sensed_c") if structure.current_lag else ()),
    )


def parameter_names(structure: Structure) -> tuple[str, ...]:
    """Return the kernel's parameters."""
    return (*control.PARAMETERS, *motion.parameter_names(structure), *PARAMETERS)


def advance(structure: Structure) -> Callable[..., Any]:
    """Return the step of one actuator.

    The order within a step is that of docs/physics.md, section 3: commutation, switching and back-EMF from
    the state at the step's start, currents by explicit Euler, torque from the new currents, then the motion.
    """
    demand_of, moved = control.control(structure), motion.motion(structure)
    half_supply_of, bus_after = (_sagging, _drawn) if structure.source else (_stiff, _nothing_drawn)
    sensed_before, sensed_after, sensor_state = (
        (_lagging, _lag, _kept) if structure.current_lag else (_exact, _no_lag, _none_kept)
    )

    def advance_one(s: Any, p: Any, u: Any) -> Any:
        demand, controlled = demand_of(s, p, u)
        reference = u.noise + demand
        angle_a, angle_b, angle_c = phase_angles(s.electrical)
        active_a, active_b, active_c = demand_sign(angle_a), demand_sign(angle_b), demand_sign(angle_c)
        shape_a, shape_b, shape_c = trapezoid(angle_a), trapezoid(angle_b), trapezoid(angle_c)
        seen_a, seen_b, seen_c = sensed_before(s)
        leg_a = switch(s.leg_a, reference * active_a - seen_a, p.hysteresis)
        leg_b = switch(s.leg_b, reference * active_b - seen_b, p.hysteresis)
        leg_c = switch(s.leg_c, reference * active_c - seen_c, p.hysteresis)

        gap_a, gap_b, gap_c = gap_factors(s.cos, s.sin, p.z_cos, p.z_sin)
        flux_a = p.flux_a * gap_a * shape_a
        flux_b = p.flux_b * gap_b * shape_b
        flux_c = p.flux_c * gap_c * shape_c
        half_supply, speed = half_supply_of(s, p), s.speed
        rise_a, rise_b, rise_c = star_slopes(
            leg_a * half_supply - p.resistance_a * s.current_a - flux_a * speed,
            leg_b * half_supply - p.resistance_b * s.current_b - flux_b * speed,
            leg_c * half_supply - p.resistance_c * s.current_c - flux_c * speed,
            p.step_per_henry_a,
            p.step_per_henry_b,
            p.step_per_henry_c,
            p.henries_per_step,
        )
        current_a = u.enabled * (s.current_a + rise_a)
        current_b = u.enabled * (s.current_b + rise_b)
        current_c = u.enabled * (s.current_c + rise_c)
        produced = flux_a * current_a + flux_b * current_b + flux_c * current_c
        torque = approach(s.torque, clip(produced, -p.torque_limit, p.torque_limit), p.torque_share)
        following = moved(s, p, u, torque)
        sensed = sensed_after(s, p, current_a, current_b, current_c)
        sensed_a, sensed_b, sensed_c = sensed
        size = np.abs(sensed_a) + np.abs(sensed_b) + np.abs(sensed_c)
        outputs = (
            0.5 * (shape_a * sensed_a + shape_b * sensed_b + shape_c * sensed_c),
            (active_a * leg_a + active_b * leg_b + active_c * leg_c) * half_supply,
            p.gear_ratio * (s.output + u.carried * (following[2] - s.output)),
            speed + u.carried * (following[0] - speed),
            s.angle + u.carried * (following[1] - s.angle),
            torque,
            reference,
            sensed_a,
            sensed_b,
            sensed_c,
            0.5 * (active_a * sensed_a + active_b * sensed_b + active_c * sensed_c),
            0.5 * np.copysign(size, torque),
            leg_a * half_supply,
            leg_b * half_supply,
            leg_c * half_supply,
        )
        drive = (torque, current_a, current_b, current_c, leg_a, leg_b, leg_c)
        drawn = bus_after(leg_a * current_a + leg_b * current_b + leg_c * current_c)
        return controlled + following + drive + drawn + sensor_state(sensed), outputs

    return advance_one


@law
def _stiff(s: Any, p: Any) -> Any:  # noqa: ARG001
    return p.half_supply


@law
def _sagging(s: Any, p: Any) -> Any:
    return sagging_supply(p.half_supply, 0.5 * p.source_resistance, s.bus_current)


@law
def _nothing_drawn(switched: Any) -> Any:  # noqa: ARG001
    return ()


@law
def _drawn(switched: Any) -> Any:
    # A leg that is high draws its phase's current from the supply; the currents add up to 0.
    return (0.5 * switched,)


@law
def _exact(s: Any) -> Any:
    return s.current_a, s.current_b, s.current_c


@law
def _lagging(s: Any) -> Any:
    return s.sensed_a, s.sensed_b, s.sensed_c


@law
def _no_lag(s: Any, p: Any, a: Any, b: Any, c: Any) -> Any:  # noqa: ARG001
    return a, b, c


@law
def _lag(s: Any, p: Any, a: Any, b: Any, c: Any) -> Any:
    share = p.sensed_share
    return approach(s.sensed_a, a, share), approach(s.sensed_b, b, share), approach(s.sensed_c, c, share)


@law
def _none_kept(sensed: Any) -> Any:  # noqa: ARG001
    return ()


@law
def _kept(sensed: Any) -> Any:
    return sensed


HYSTERESIS_BLDC = Form(CHANNELS, OBSERVABLE, parameters, initial_state, state_names, parameter_names, advance)
"""The thesis's motor and drive."""
