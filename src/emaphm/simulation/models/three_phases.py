"""Common parts of all models of three switched phases: windings, supply, current and Hall sensors."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from emaphm.actuator.unit.baseline import COMMUTATION, HALL_SENSORS
from emaphm.arrays import Array
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.angles import phase_angles
from emaphm.simulation.laws.commutation import demand_sign
from emaphm.simulation.laws.emf_shape import emf_shape
from emaphm.simulation.laws.lag import approach, share_of_step
from emaphm.simulation.laws.phases import Phases, by_phase, phase_names
from emaphm.simulation.laws.saturation import flux_left
from emaphm.simulation.laws.sensed_commutation import hall_signals, seen_angle, signalled_demand
from emaphm.simulation.laws.star_windings import star_slopes
from emaphm.simulation.laws.supply_source import sagging_supply
from emaphm.simulation.laws.voltage_drop import knees_per_ampere, voltage_drop
from emaphm.simulation.models import control, motion

PARAMETERS = (
    "half_supply",
    *phase_names("resistance"),
    *phase_names("step_per_henry"),
    "henries_per_step",
    *phase_names("flux"),
    "z_cos",
    "z_sin",
    "source_resistance",
    "sensed_share",
    "saturation",
    "flat_loss",
    "sine_share",
    *HALL_SENSORS,
    *COMMUTATION,
    "leg_drop",
    "per_knee",
)

CURRENTS, SENSED, SIGNALS = phase_names("current"), phase_names("sensed"), phase_names("signal")


def parameters(plant: Plant, step: float, peak: float) -> dict[str, Array]:
    """Return the parameters of windings, supply and sensors at `step` [s], (n,) each.

    `peak` is the amplitude of a phase's back-EMF per speed for a line-to-line torque constant of 1.
    """
    per_henry = step / (plant.inductance / 2 * plant.turns**2)
    return {
        "half_supply": plant.supply / 2,
        "henries_per_step": 1 / per_henry.sum(axis=0),
        "z_cos": plant.z[0],
        "z_sin": plant.z[1],
        "source_resistance": plant.source_resistance,
        "sensed_share": share_of_step(plant.current_lag, step),
        "saturation": plant.saturation,
        "flat_loss": plant.flat_loss,
        "sine_share": plant.sine_share,
        **{name: getattr(plant, name) for name in (*HALL_SENSORS, *COMMUTATION)},
        "leg_drop": plant.voltage_drop / 2,
        "per_knee": knees_per_ampere(plant.current_limit),
        **by_phase("resistance", plant.resistance / 2 * plant.turns),
        **by_phase("step_per_henry", per_henry),
        **by_phase("flux", peak * plant.torque_constant * plant.turns),
    }


def current_loop_parameters(plant: Plant, step: float) -> dict[str, Array]:
    """Return the parameters, at `step` [s], of a PI current loop sampled once per PWM period, (n,) each."""
    period = 1 / np.maximum(plant.pwm_frequency, 1.0)
    return {
        "current_gain": plant.current_gain,
        "current_integral_gain": plant.current_integral_gain,
        "period": period,
        "step_per_period": step / period,
    }


def initial_state(plant: Plant) -> dict[str, Array]:
    """Return the state of torque, windings, supply and current sensors without current, (n,) each."""
    return dict.fromkeys(("torque", *CURRENTS, "bus_current", *SENSED), np.zeros(plant.count))


def initial_signals(plant: Plant, electrical: Array) -> dict[str, Array]:
    """Return the state of the Hall sensors, (n,) each, at the rotor's `electrical` angle (n,) [rad]."""
    low = Phases(-1.0, -1.0, -1.0)
    signals = hall_signals(low, phase_angles(electrical), Phases.of(plant, "hall"), 0.0)
    return dict(zip(SIGNALS, signals, strict=True))


def optional_state_names(structure: Structure) -> tuple[str, ...]:
    """Return the names of the state of supply and sensors for the optional laws of the actuator."""
    return (
        *(("bus_current",) if structure.source else ()),
        *(SENSED if structure.current_lag else ()),
        *(SIGNALS if structure.commutation else ()),
    )


def state_names(structure: Structure, own: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the kernel's state; `own` are the names of the state of the model's drive."""
    return (
        *control.state_names(structure),
        *motion.state_names(structure),
        "torque",
        *CURRENTS,
        *own,
        *optional_state_names(structure),
    )


def parameter_names(structure: Structure, own: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the kernel's parameters; `own` are those of the model's drive."""
    return (*control.PARAMETERS, *motion.parameter_names(structure), *PARAMETERS, *own)


class Laws(NamedTuple):
    """Laws of windings, supply and sensors for the structure of an actuator.

    Currents, voltages, fluxes and back-EMFs are `Phases`; s and p are state and parameters.
    """

    commutation: Callable[..., Any]
    """(s, p, angles of the phases): reference current of each phase relative to the drive's, and the next
    state of the Hall sensors."""
    emf_shape: Callable[..., Any]
    """(p, angles of the phases, their unit trapezoids): shapes of a back-EMF that is not sinusoidal."""
    flux: Callable[..., Any]
    """(current, p, factors of the gap, shapes of the back-EMF): back-EMF per speed, torque per current."""
    against: Callable[..., Any]
    """(current, p, back-EMF): voltage that opposes the winding's: back-EMF plus the inverter's drop."""
    half_supply: Callable[..., Any]
    """(s, p): half the supply voltage."""
    bus_after: Callable[..., Any]
    """(sum of leg state times current): next state of the supply."""
    sensed_before: Callable[..., Any]
    """(s): output of the current sensors before the step."""
    sensed_after: Callable[..., Any]
    """(s, p, current): output of the current sensors after the step."""
    sensor_state: Callable[..., Any]
    """(output of the current sensors after the step): their next state."""


def laws(structure: Structure) -> Laws:
    """Return the laws of windings, supply and sensors for `structure`."""
    return Laws(
        _by_hall_sensors if structure.commutation else _by_angle,
        _shaped if structure.emf_shape else _trapezoidal,
        _saturated if structure.saturation else _unsaturated,
        _with_drop if structure.voltage_drop else _back_emf,
        *((_sagging_supply, _bus_state) if structure.source else (_stiff_supply, _no_bus_state)),
        *((_lagging, _lag, _lag_state) if structure.current_lag else (_exact, _no_lag, _no_sensor_state)),
    )


def currents_after(current: Phases, p: Any, voltage: Phases, back_emf: Phases) -> Any:
    """Return the three phase currents [A] after an explicit Euler step."""
    drive = voltage - Phases.of(p, "resistance") * current - back_emf
    return current + star_slopes(drive, Phases.of(p, "step_per_henry"), p.henries_per_step)


def _by_angle(s: Any, p: Any, angles: Phases) -> Any:  # noqa: ARG001
    return demand_sign(angles), ()


def _by_hall_sensors(s: Any, p: Any, angles: Phases) -> Any:  # noqa: ARG001
    commutation_angle = seen_angle(
        s.electrical, p.pole_pairs * s.speed, p.commutation_lag, p.commutation_delay
    )
    early = Phases.of(p, "hall")
    signals = hall_signals(Phases.of(s, "signal"), phase_angles(commutation_angle), early, p.commutation_lag)
    return signalled_demand(signals), tuple(signals)


def _trapezoidal(p: Any, angle: Phases, shape: Phases) -> Phases:  # noqa: ARG001
    return shape


def _shaped(p: Any, angle: Phases, shape: Phases) -> Any:  # noqa: ARG001
    return emf_shape(angle, p.flat_loss, p.sine_share)


def _unsaturated(current: Phases, p: Any, gap: Phases, shape: Phases) -> Any:  # noqa: ARG001
    return Phases.of(p, "flux") * gap * shape


def _saturated(current: Phases, p: Any, gap: Phases, shape: Phases) -> Any:
    # |i| for two conducting phases with i and -i; the length of the vector, line to line, for three sines.
    factor = flux_left(p.saturation, np.sqrt(0.5 * (current * current).sum()))
    return factor * _unsaturated(current, p, gap, shape)


def _back_emf(current: Phases, p: Any, back_emf: Phases) -> Any:  # noqa: ARG001
    return back_emf


def _with_drop(current: Phases, p: Any, back_emf: Phases) -> Any:
    return back_emf + voltage_drop(current, p.leg_drop, p.per_knee)


def _stiff_supply(s: Any, p: Any) -> Any:  # noqa: ARG001
    return p.half_supply


def _sagging_supply(s: Any, p: Any) -> Any:
    return sagging_supply(p.half_supply, 0.5 * p.source_resistance, s.bus_current)


def _no_bus_state(switched: Any) -> Any:  # noqa: ARG001
    return ()


def _bus_state(switched: Any) -> Any:
    # A leg that is high draws its phase's current from the supply; the sum of the currents is 0.
    return (0.5 * switched,)


def _exact(s: Any) -> Phases:
    return Phases.of(s, "current")


def _lagging(s: Any) -> Phases:
    return Phases.of(s, "sensed")


def _no_lag(s: Any, p: Any, current: Phases) -> Any:  # noqa: ARG001
    return current


def _lag(s: Any, p: Any, current: Phases) -> Any:
    return approach(Phases.of(s, "sensed"), current, p.sensed_share)


def _no_sensor_state(sensed: Phases) -> tuple[Any, ...]:  # noqa: ARG001
    return ()


def _lag_state(sensed: Phases) -> tuple[Any, ...]:
    return tuple(sensed)
