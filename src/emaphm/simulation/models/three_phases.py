"""What all models of three switched phases share: windings, supply, current sensors, recorded motion."""

from collections.abc import Callable
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.lag import approach, share_of_step
from emaphm.simulation.laws.saturation import flux_left
from emaphm.simulation.laws.star_windings import star_slopes
from emaphm.simulation.laws.supply_source import sagging_supply
from emaphm.simulation.laws.voltage_drop import knees_per_ampere, voltage_drop
from emaphm.simulation.models import control, motion

PARAMETERS = (
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
    "saturation",
    "leg_drop",
    "per_knee",
)

CURRENTS = ("current_a", "current_b", "current_c")


def parameters(plant: Plant, step: float, peak: float) -> dict[str, Array]:
    """Return the parameters of windings, supply and sensors at `step` [s], (n,) each.

    `peak` is the amplitude of a phase's back-EMF per speed for a torque constant of 1, line to line.
    """
    per_henry = step / (plant.inductance / 2 * plant.turns**2)
    rows = {
        "half_supply": plant.supply / 2,
        "henries_per_step": 1 / per_henry.sum(axis=0),
        "z_cos": plant.z[0],
        "z_sin": plant.z[1],
        "source_resistance": plant.source_resistance,
        "sensed_share": share_of_step(plant.current_lag, step),
        "saturation": plant.saturation,
        "leg_drop": plant.voltage_drop / 2,
        "per_knee": knees_per_ampere(plant.current_limit),
    }
    for i, phase in enumerate("abc"):
        rows |= {
            f"resistance_{phase}": plant.resistance / 2 * plant.turns[i],
            f"step_per_henry_{phase}": per_henry[i],
            f"flux_{phase}": peak * plant.torque_constant * plant.turns[i],
        }
    return rows


def initial_state(plant: Plant) -> dict[str, Array]:
    """Return the state of torque, windings, supply and sensors, (n,) each: no current."""
    sensed = ("sensed_a", "sensed_b", "sensed_c")
    return dict.fromkeys(("torque", *CURRENTS, "bus_current", *sensed), np.zeros(plant.count))


def optional_state_names(structure: Structure) -> tuple[str, ...]:
    """Return the state of supply and sensors, where the actuator has their laws."""
    return (
        *(("bus_current",) if structure.source else ()),
        *(("sensed_a", "sensed_b", "sensed_c") if structure.current_lag else ()),
    )


def state_names(structure: Structure, own: tuple[str, ...]) -> tuple[str, ...]:
    """Return the kernel's state; `own` is that of the model's drive."""
    return (
        *control.state_names(structure),
        *motion.state_names(structure),
        "torque",
        *CURRENTS,
        *own,
        *optional_state_names(structure),
    )


def parameter_names(structure: Structure, own: tuple[str, ...]) -> tuple[str, ...]:
    """Return the kernel's parameters; `own` are those of the model's drive."""
    return (*control.PARAMETERS, *motion.parameter_names(structure), *PARAMETERS, *own)


def supply(structure: Structure) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return half the supply voltage, of (state, parameters), and its next state, of Σ s_i i_i."""
    return (_sagging, _drawn) if structure.source else (_stiff, _nothing_drawn)


def flux(structure: Structure) -> Callable[..., Any]:
    """Return the flux of each phase: its back-EMF per speed, and its torque per current.

    Of (state, parameters, factors of the gap at a, b and c, shapes of a, b and c).
    """
    return _saturated if structure.saturation else _unsaturated


def counter_voltage(structure: Structure) -> Callable[..., Any]:
    """Return what the windings of each phase have against them: back-EMF, and what the inverter takes.

    Of (state, parameters, back-EMF of a, b and c).
    """
    return _with_drop if structure.voltage_drop else _back_emf


def sensors(structure: Structure) -> tuple[Callable[..., Any], Callable[..., Any], Callable[..., Any]]:
    """Return what the current sensors show before a step and after it, and their next state."""
    return (_lagging, _lag, _kept) if structure.current_lag else (_exact, _no_lag, _none_kept)


def currents_after(
    s: Any,
    p: Any,
    voltage_a: Any,
    voltage_b: Any,
    voltage_c: Any,
    back_emf_a: Any,
    back_emf_b: Any,
    back_emf_c: Any,
) -> Any:
    """Return the three phase currents after an explicit Euler step [A]."""
    rise_a, rise_b, rise_c = star_slopes(
        voltage_a - p.resistance_a * s.current_a - back_emf_a,
        voltage_b - p.resistance_b * s.current_b - back_emf_b,
        voltage_c - p.resistance_c * s.current_c - back_emf_c,
        p.step_per_henry_a,
        p.step_per_henry_b,
        p.step_per_henry_c,
        p.henries_per_step,
    )
    return s.current_a + rise_a, s.current_b + rise_b, s.current_c + rise_c


def _unsaturated(
    s: Any,  # noqa: ARG001
    p: Any,
    gap_a: Any,
    gap_b: Any,
    gap_c: Any,
    shape_a: Any,
    shape_b: Any,
    shape_c: Any,
) -> Any:
    return p.flux_a * gap_a * shape_a, p.flux_b * gap_b * shape_b, p.flux_c * gap_c * shape_c


def _saturated(
    s: Any, p: Any, gap_a: Any, gap_b: Any, gap_c: Any, shape_a: Any, shape_b: Any, shape_c: Any
) -> Any:
    # Two conducting phases have i and -i; of three sines it is the length of their vector, line to line.
    squares = s.current_a * s.current_a + s.current_b * s.current_b + s.current_c * s.current_c
    left = flux_left(p.saturation, np.sqrt(0.5 * squares))
    flux_a, flux_b, flux_c = _unsaturated(s, p, gap_a, gap_b, gap_c, shape_a, shape_b, shape_c)
    return left * flux_a, left * flux_b, left * flux_c


def _back_emf(s: Any, p: Any, a: Any, b: Any, c: Any) -> Any:  # noqa: ARG001
    return a, b, c


def _with_drop(s: Any, p: Any, a: Any, b: Any, c: Any) -> Any:
    return (
        a + voltage_drop(s.current_a, p.leg_drop, p.per_knee),
        b + voltage_drop(s.current_b, p.leg_drop, p.per_knee),
        c + voltage_drop(s.current_c, p.leg_drop, p.per_knee),
    )


def _stiff(s: Any, p: Any) -> Any:  # noqa: ARG001
    return p.half_supply


def _sagging(s: Any, p: Any) -> Any:
    return sagging_supply(p.half_supply, 0.5 * p.source_resistance, s.bus_current)


def _nothing_drawn(switched: Any) -> Any:  # noqa: ARG001
    return ()


def _drawn(switched: Any) -> Any:
    # A leg that is high draws its phase's current from the supply; the currents add up to 0.
    return (0.5 * switched,)


def _exact(s: Any) -> Any:
    return s.current_a, s.current_b, s.current_c


def _lagging(s: Any) -> Any:
    return s.sensed_a, s.sensed_b, s.sensed_c


def _no_lag(s: Any, p: Any, a: Any, b: Any, c: Any) -> Any:  # noqa: ARG001
    return a, b, c


def _lag(s: Any, p: Any, a: Any, b: Any, c: Any) -> Any:
    share = p.sensed_share
    return approach(s.sensed_a, a, share), approach(s.sensed_b, b, share), approach(s.sensed_c, c, share)


def _none_kept(sensed: Any) -> Any:  # noqa: ARG001
    return ()


def _kept(sensed: Any) -> Any:
    return sensed
