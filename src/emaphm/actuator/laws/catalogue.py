"""The optional laws by name, with their parameters, start values and the manoeuvres that excite them."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from emaphm.actuator.actuator import Actuator
from emaphm.actuator.law_sections import HIGHEST_ORDER
from emaphm.actuator.laws.reasons import reason_against
from emaphm.actuator.unit.baseline import COMMUTATION, HALL_SENSORS, MOST_HARMONICS
from emaphm.errors import MethodError, nearest

Sections = dict[str, dict[str, Any] | list[dict[str, Any]]]


@dataclass(frozen=True)
class Law:
    """An optional law of an actuator.

    Attributes
    ----------
    name
        Name of the law, as in `--laws`.
    parameters
        Lumped parameters of the law, which are free in a calibration.
    also_free
        Lumped parameters of the description that are estimated together with those of the law.
    needs
        Laws without which the law has no effect.
    excited_by
        Manoeuvre from which its parameters are identifiable.
    start
        Start values of a search by section, as a function of actuator and typical motor speed [rad/s].
    by_faults
        Whether its parameters are identifiable only if faults make the phases differ: not by calibration.
    """

    name: str
    parameters: tuple[str, ...]
    excited_by: str
    start: Callable[[Actuator, float], Sections]
    also_free: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    by_faults: bool = False

    def is_in(self, actuator: Actuator) -> bool:
        """Return whether `actuator` has the law."""
        return all(
            _described(actuator, section, key)
            for section, values in self.start(actuator, 1.0).items()
            for key in (values if isinstance(values, dict) else {"": None})
        )

    def reason_against(self, actuator: Actuator) -> str:
        """Return the reason why `actuator` cannot have the law, empty if it can."""
        return reason_against(self.name, actuator)

    def is_possible(self, actuator: Actuator) -> bool:
        """Return whether the law can be added to `actuator`: it is possible and not yet described."""
        return not self.is_in(actuator) and not self.reason_against(actuator)

    def added_to(self, actuator: Actuator, speed: float | None = None) -> Actuator:
        """Return `actuator` with the law and the laws that it needs, at the start values of a search.

        Values of the law that are already described are not changed.

        Parameters
        ----------
        speed
            Typical speed of the motor [rad/s], such as its rms; if omitted, computed from the drive's limit.

        Raises
        ------
        MethodError
            The actuator cannot have the law.
        """
        reason = self.reason_against(actuator)
        if reason:
            raise MethodError(f"actuator '{actuator.name}' cannot have law '{self.name}': {reason}")
        if self.is_in(actuator):
            return actuator
        for needed in self.needs:
            actuator = law_named(needed).added_to(actuator, speed)
        typical = speed or typical_speed(actuator)
        description = actuator.model_dump(exclude_none=True)
        for section, values in self.start(actuator, typical).items():
            present = description.get(section)
            if isinstance(values, list):
                description[section] = [*(present or []), *values]
            elif section in ALWAYS_DESCRIBED:
                description[section] = description[section] | values
            else:
                description[section] = values | (present or {})
        return Actuator.from_dict(description, where=actuator.name)


def largest_speed(actuator: Actuator) -> float:
    """Return the largest motor speed [rad/s] from controller and supply, infinite without both limits."""
    limits = [actuator.controller.speed_limit or math.inf]
    if actuator.electrical is not None:
        limits.append(actuator.electrical.supply / actuator.motor.torque_constant)
    return min(limits)


def typical_speed(actuator: Actuator) -> float:
    """Return a typical motor speed in use [rad/s]: a quarter of the largest, or 1 if that is infinite."""
    largest = largest_speed(actuator)
    return largest / 4 if math.isfinite(largest) else 1.0


ALWAYS_DESCRIBED = ("mechanics", "controller")
"""Sections that every actuator has: the parameters of an absent law are 0 in them."""


def _described(actuator: Actuator, section: str, key: str) -> bool:
    described = getattr(actuator, section)
    if section == "ripple":
        return bool(described)
    value = getattr(described, key, None)
    return bool(value) if section in ALWAYS_DESCRIBED else value is not None


def typical_dry_friction(actuator: Actuator) -> float:
    """Return a torque of the order of magnitude of dry friction [N·m]."""
    m = actuator.mechanics
    largest = actuator.controller.current_limit * actuator.motor.torque_constant
    return m.dynamic_friction or m.static_friction or 0.02 * largest


def _stribeck(actuator: Actuator, speed: float) -> Sections:
    m = actuator.mechanics
    sections: Sections = {"friction": {"stribeck_speed": 0.05 * speed}}
    if m.static_friction <= m.dynamic_friction:
        factor = 1.3 * typical_dry_friction(actuator) / max(m.static_friction, 1e-300)
        sections["mechanics"] = {
            "static_friction_motor": m.static_friction_motor * factor or 1.3 * typical_dry_friction(actuator),
            "static_friction_user": m.static_friction_user * factor,
        }
    return sections


def _presliding(actuator: Actuator, speed: float) -> Sections:
    # The bristles slide after the angle that the motor turns in 50 µs; a search covers 2 µs to 1.5 ms.
    stiffness = typical_dry_friction(actuator) / (5e-5 * speed)
    damping = 0.5 * math.sqrt(stiffness * actuator.mechanics.inertia)
    return {"friction": {"presliding_stiffness": stiffness, "presliding_damping": damping}}


def _compliance(actuator: Actuator, speed: float) -> Sections:  # noqa: ARG001
    m = actuator.mechanics
    # Resonance of motor and user at 500 Hz, with a damping ratio of 0.05.
    reduced = m.inertia_motor * m.inertia_user / m.inertia
    natural = 2 * math.pi * 500
    return {"transmission": {"stiffness": natural**2 * reduced, "damping": 0.1 * natural * reduced}}


def _cogging(actuator: Actuator, speed: float) -> Sections:  # noqa: ARG001
    """Return the first orders of the turn, those of usual numbers of slots, and that of the electrical turn.

    Zeros of the drive's current sensors cause a ripple once per electrical turn.
    """
    pairs = actuator.pole_pairs
    orders = sorted({1, 2, pairs, 2 * pairs, 6 * pairs, 12 * pairs})
    return {"ripple": [{"order": order, "of": "motor"} for order in orders if order <= HIGHEST_ORDER]}


def _drive(actuator: Actuator, **values: float) -> Sections:
    return {"drive": {"kind": actuator.drive_kind, **values}}


_ALL = (
    Law(
        "load-dependent",
        ("load_friction",),
        "a manoeuvre under a load that changes, such as lifting and lowering a weight",
        lambda actuator, speed: {"friction": {"load_friction": 0.05}},  # noqa: ARG005
    ),
    Law(
        "load-split",
        ("load_motor", "load_external"),
        "lifting and lowering a weight, driven by the motor and by the weight",
        lambda actuator, speed: {"friction": {"load_motor": 0.02, "load_external": 0.02}},  # noqa: ARG005
        needs=("load-dependent",),
    ),
    Law(
        "stribeck",
        ("stribeck_speed",),
        "slow reversals: a sinusoid or ramp at low speed",
        _stribeck,
        also_free=("static",),
    ),
    Law(
        "stribeck-load",
        ("stribeck_load_motor", "stribeck_load_external"),
        "slow reversals under a load that changes",
        lambda actuator, speed: {  # noqa: ARG005
            "friction": {"stribeck_load_motor": 0.02, "stribeck_load_external": 0.02}
        },
        needs=("stribeck",),
    ),
    Law(
        "directional",
        ("coulomb_asymmetry", "viscous_asymmetry"),
        "the same motion forward and backward, without a change of the load",
        lambda actuator, speed: {"friction": {"coulomb_asymmetry": 0.0, "viscous_asymmetry": 0.0}},  # noqa: ARG005
    ),
    Law(
        "quadratic",
        ("quadratic",),
        "several speeds up to the largest",
        lambda actuator, speed: {"friction": {"quadratic": 0.2 * typical_dry_friction(actuator) / speed**2}},
    ),
    Law(
        "transition",
        ("transition_speed",),
        "slow reversals and starts from rest",
        lambda actuator, speed: {"friction": {"transition_speed": 0.005 * speed}},  # noqa: ARG005
    ),
    Law(
        "presliding",
        ("presliding_stiffness", "presliding_damping"),
        "slow reversals and small motion about rest",
        _presliding,
        # Without a Stribeck speed, the bristle model has no static friction.
        also_free=("stribeck_speed", "static"),
        needs=("stribeck",),
    ),
    Law(
        "viscous-temperature",
        ("viscous_temperature",),
        "recordings at temperatures at least 20 K apart, with the temperature recorded",
        lambda actuator, speed: {"friction": {"viscous_temperature": 0.01}},  # noqa: ARG005
    ),
    Law(
        "compliance",
        ("stiffness", "damping"),
        "a fast reversal or step, with the position recorded",
        _compliance,
    ),
    Law(
        "gravity",
        ("gravity", "gravity_angle"),
        "slow motion over a large part of a turn",
        lambda actuator, speed: {"weight": {"gravity": typical_dry_friction(actuator)}},  # noqa: ARG005
    ),
    Law(
        "cogging",
        tuple(f"ripple{i + 1}_{part}" for i in range(MOST_HARMONICS) for part in ("cos", "sin")),
        "slow motion over at least one turn of the motor, with its angle recorded",
        _cogging,
    ),
    Law(
        "command-lag",
        ("command_lag",),
        "fast changes of the command, with the position recorded",
        lambda actuator, speed: {"controller": {"command_lag": 2e-3}},  # noqa: ARG005
    ),
    Law(
        "speed-lag",
        ("speed_lag",),
        "fast reversals, with the position or the speed recorded",
        lambda actuator, speed: {"controller": {"speed_lag": 5e-4}},  # noqa: ARG005
    ),
    Law(
        "speed-integral",
        ("integral_gain",),
        "motion under dry friction or a load, with the position or the speed recorded",
        # Integral time constant of about 33 ms: integral gain over proportional gain is 30 1/s.
        lambda actuator, speed: {"controller": {"integral_gain": 30 * actuator.controller.speed_gain}},  # noqa: ARG005
    ),
    Law(
        "position-integral",
        ("position_integral_gain",),
        "slow motion under a load, with the position recorded",
        lambda actuator, speed: {"controller": {"position_integral_gain": 5.0}},  # noqa: ARG005
    ),
    Law(
        "feedforward",
        ("speed_feedforward",),
        "fast motion, with the position recorded",
        lambda actuator, speed: {"controller": {"speed_feedforward": 0.3}},  # noqa: ARG005
    ),
    Law(
        "saturation",
        ("saturation",),
        "large currents and small ones at like speeds: hard accelerations and steady motion",
        lambda actuator, speed: {"motor": {"saturation": 0.0}},  # noqa: ARG005
    ),
    Law(
        "emf-flats",
        ("flat_loss",),
        "fast motion with the current and the voltage recorded",
        lambda actuator, speed: {"motor": {"flat_loss": 0.2}},  # noqa: ARG005
        also_free=("torque_constant",),
    ),
    Law(
        "emf-sine",
        ("sine_share",),
        "fast motion with the current and the voltage recorded",
        lambda actuator, speed: {"motor": {"sine_share": 0.0}},  # noqa: ARG005
        also_free=("torque_constant",),
    ),
    Law(
        "hall-angles",
        HALL_SENSORS,
        "fast motion of phases that differ, with the current recorded",
        lambda actuator, speed: {"motor": dict.fromkeys(HALL_SENSORS, 0.0)},  # noqa: ARG005
        by_faults=True,
    ),
    Law(
        "commutation-lag",
        COMMUTATION,
        "fast motion of phases that differ, with the current recorded",
        lambda actuator, speed: _drive(actuator, **dict.fromkeys(COMMUTATION, 0.0)),  # noqa: ARG005
        by_faults=True,
    ),
    Law(
        "winding-temperature",
        ("temperature_gain",),
        "recordings at temperatures at least 10 K apart, with the temperature recorded",
        lambda actuator, speed: {"electrical": {"temperature_gain": 2.0}},  # noqa: ARG005
    ),
    Law(
        "sensor-lag",
        ("current_lag",),
        "fast changes of the current, sampled at 5 kHz or more",
        lambda actuator, speed: _drive(actuator, current_lag=5e-6),  # noqa: ARG005
    ),
    Law(
        "source-resistance",
        ("source_resistance",),
        "large currents with the line or supply voltage recorded",
        lambda actuator, speed: _drive(  # noqa: ARG005
            actuator, source_resistance=0.05 * actuator.electrical.resistance if actuator.electrical else 0.0
        ),
    ),
    Law(
        "inverter-drop",
        ("voltage_drop",),
        "currents of both signs with the voltage recorded that the drive commands",
        lambda actuator, speed: _drive(  # noqa: ARG005
            actuator, voltage_drop=0.01 * actuator.electrical.supply if actuator.electrical else 0.0
        ),
    ),
)

LAWS: Mapping[str, Law] = {law.name: law for law in _ALL}
"""The optional laws by name, in the order in which a calibration tests them."""


def law_named(name: str) -> Law:
    """Return the law of that name; `MethodError` with the nearest name if there is none."""
    if name not in LAWS:
        raise MethodError(f"unknown law '{name}'{nearest(name, LAWS)}")
    return LAWS[name]


def laws_of(actuator: Actuator) -> tuple[str, ...]:
    """Return the names of the optional laws that `actuator` has."""
    return tuple(name for name, law in LAWS.items() if law.is_in(actuator))
