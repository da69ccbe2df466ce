"""Optional sections of an actuator: laws of friction, transmission, load and drive beyond the thesis.

A law whose values are omitted is absent and takes no time in a simulation. All values are referred to the
motor shaft unless stated otherwise. Equations and sources are in `emaphm.simulation.laws`.
"""

from typing import Literal, Self

from pydantic import model_validator

from emaphm.actuator.quantity import CHOSEN, ELECTRICAL_ANGLE, quantity
from emaphm.actuator.section import Section

BAM = "arXiv 2410.08650"

HIGHEST_ORDER = 200
"""Highest order of a torque ripple, in periods per turn."""


class Friction(Section):
    """Laws of dry and viscous friction in addition to their values in [mechanics]."""

    stribeck_speed: float | None = quantity(
        "speed over which static friction falls to dynamic friction",
        "rad/s",
        "Armstrong 1994",
        default=None,
        gt=0,
    )
    load_friction: float | None = quantity(
        "friction per transmitted torque, of the motor and external alike, K_l",
        "-",
        BAM,
        default=None,
        ge=0,
        lt=1,
    )
    load_motor: float | None = quantity(
        "friction per torque of the motor beyond K_l", "-", BAM, default=None, ge=0, lt=1
    )
    load_external: float | None = quantity(
        "friction per external torque beyond K_l", "-", BAM, default=None, ge=0, le=10
    )
    stribeck_load_motor: float | None = quantity(
        "the same at low speed, beyond K_m", "-", BAM, default=None, ge=0, lt=1
    )
    stribeck_load_external: float | None = quantity(
        "the same at low speed, beyond K_e", "-", BAM, default=None, ge=0, le=10
    )
    coulomb_asymmetry: float | None = quantity(
        "dry friction forward × (1 + a), backward × (1 - a)",
        "-",
        "Janot 2019",
        default=None,
        gt=-1,
        lt=1,
    )
    viscous_asymmetry: float | None = quantity(
        "viscous friction forward × (1 + a), backward × (1 - a)",
        "-",
        "Janot 2019",
        default=None,
        gt=-1,
        lt=1,
    )
    quadratic: float | None = quantity("friction per speed squared", "N·m·s²/rad²", BAM, default=None, ge=0)
    transition_speed: float | None = quantity(
        "speed over which dry friction passes through standstill; it sticks where left out",
        "rad/s",
        CHOSEN,
        default=None,
        gt=0,
    )
    presliding_stiffness: float | None = quantity(
        "stiffness of dry friction before it slides; it sticks where left out",
        "N·m/rad",
        "Canudas de Wit 1995",
        default=None,
        gt=0,
    )
    presliding_damping: float | None = quantity(
        "damping of its give before it slides",
        "N·m·s/rad",
        "Canudas de Wit 1995",
        default=None,
        ge=0,
    )
    viscous_temperature: float | None = quantity(
        "fall of viscous friction with temperature, exp(-β ΔT)", "1/K", CHOSEN, default=None, ge=0, le=1
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        low_speed = self.stribeck_load_motor is not None or self.stribeck_load_external is not None
        if low_speed and self.stribeck_speed is None:
            raise ValueError(
                "stribeck_load_motor and stribeck_load_external act at low speed: give stribeck_speed too"
            )
        if self.transition_speed is not None and self.presliding_stiffness is not None:
            raise ValueError(
                "transition_speed and presliding_stiffness both say how friction acts at standstill: give one"
            )
        if self.presliding_damping is not None and self.presliding_stiffness is None:
            raise ValueError("presliding_damping is that of a stiffness: give presliding_stiffness too")
        return self


class Transmission(Section):
    """A compliant shaft between the inertias of motor and user; rigid if the section is omitted."""

    stiffness: float = quantity("of shaft and gear, the backlash in series", "N·m/rad", CHOSEN, gt=0)
    damping: float = quantity("in parallel to the stiffness", "N·m·s/rad", CHOSEN, default=0.0, ge=0)


class Weight(Section):
    """A weight that turns with the user; a positive load opposes positive motion."""

    gravity: float = quantity("largest torque of the weight, m g l × gear ratio", "N·m", CHOSEN, ge=0)
    gravity_angle: float = quantity(
        "position of the user, with its sign turned, where the weight hangs straight down",
        "rad",
        CHOSEN,
        default=0.0,
    )


class RippleHarmonic(Section):
    """One harmonic of the torque ripple: cos × cos nθ + sin × sin nθ is added to the motor's torque."""

    order: int = quantity("periods per turn, n", "-", CHOSEN, ge=1, le=HIGHEST_ORDER)
    of: Literal["motor", "screw"] = "motor"
    cos: float = quantity("amplitude with the cosine", "N·m", CHOSEN, default=0.0)
    sin: float = quantity("amplitude with the sine", "N·m", CHOSEN, default=0.0)


DriveKind = Literal["hysteresis", "current", "voltage", "six-step", "foc"]


class Drive(Section):
    """The drive, which feeds the windings.

    hysteresis: three-phase BLDC motor, one comparator per phase (thesis); six-step: the same motor with PI
    current control and PWM; foc: three-phase motor with sinusoidal back-EMF, PI control of d-axis and q-axis
    currents, and PWM; voltage: DC motor, the speed loop demands a duty cycle; current: ideal current loop.
    """

    kind: DriveKind
    current_gain: float | None = quantity("current control, proportional", "V/A", CHOSEN, default=None, gt=0)
    current_integral_gain: float | None = quantity(
        "current control, integral", "V/(A·s)", CHOSEN, default=None, ge=0
    )
    pwm_frequency: float | None = quantity(
        "of the pulse-width modulation; the currents are controlled once a period",
        "Hz",
        CHOSEN,
        default=None,
        ge=1e3,
        le=2e5,
    )
    source_resistance: float | None = quantity(
        "of the supply and its leads", "ohm", CHOSEN, default=None, ge=0
    )
    voltage_drop: float | None = quantity(
        "of the switches that the current passes, beyond the commanded voltage, which is recorded",
        "V",
        CHOSEN,
        default=None,
        ge=0,
    )
    current_lag: float | None = quantity(
        "time constant of the current sensors, for the drive as for the recorder",
        "s",
        CHOSEN,
        default=None,
        ge=0,
        le=1e-3,
    )
    commutation_lag: float | None = quantity(
        "electrical angle by which commutation is late in either direction, as by the hysteresis of Hall "
        "sensors; below 0 it is early",
        ELECTRICAL_ANGLE,
        CHOSEN,
        default=None,
        ge=-0.2,
        le=0.2,
    )
    commutation_delay: float | None = quantity(
        "time by which commutation is late; below 0 it is early",
        "s",
        CHOSEN,
        default=None,
        ge=-2e-4,
        le=2e-4,
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.kind in ("six-step", "foc"):
            for name in ("current_gain", "current_integral_gain", "pwm_frequency"):
                if getattr(self, name) is None:
                    raise ValueError(f"a drive of kind '{self.kind}' needs {name}; add it")
        return self
