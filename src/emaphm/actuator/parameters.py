"""The parameters of an actuator, validated, each with its unit and source.

Symbols and values follow the thesis (Tab. 3.1). A linear actuator uses the same fields with m, N and kg in
place of rad, N·m and kg·m²; with a rotary motor and a screw, only the user's quantities are in m. All
mechanical quantities are referred to the motor shaft.
"""

import math
from typing import Self

from pydantic import model_validator

from emaphm.actuator.quantity import CHOSEN, ELECTRICAL_ANGLE, THESIS, USER_ANGLE, quantity
from emaphm.actuator.section import Section
from emaphm.errors import SignalError


class Controller(Section):
    """Cascade of a position loop (P, PI or PID), a speed loop (PID) and a current loop, each with its limit.

    If the drive is of kind "voltage", the output of the speed loop is the duty cycle, limited to ±1, and its
    gains are in s/rad and 1/rad in place of N·m·s/rad and N·m/rad.
    """

    position_gain: float = quantity(
        "speed demand per position error at the user, G_prop", f"rad/(s·{USER_ANGLE})", THESIS, gt=0
    )
    speed_gain: float = quantity("speed loop, proportional, GAP", "N·m·s/rad", THESIS, gt=0)
    integral_gain: float = quantity("speed loop, integral, GAI", "N·m/rad", THESIS, default=0.0, ge=0)
    derivative_gain: float = quantity("speed loop, derivative, GAD", "N·m·s²/rad", THESIS, default=0.0, ge=0)
    speed_limit: float | None = quantity(
        "limit of the speed demand; none where left out", "rad/s", "thesis 3.1.2", default=None, gt=0
    )
    current_limit: float = quantity("limit of the current demand, I_max", "A", THESIS, gt=0)
    torque_constant: float | None = quantity(
        "torque per ampere that the drive assumes, k_t; the motor's where left out",
        "N·m/A",
        THESIS,
        default=None,
        gt=0,
    )
    position_integral_gain: float = quantity(
        "position loop, integral: 1 / T_i, relative to position_gain", "1/s", CHOSEN, default=0.0, ge=0
    )
    position_derivative_gain: float = quantity(
        "position loop, derivative: T_d, relative to position_gain", "s", CHOSEN, default=0.0, ge=0
    )
    command_lag: float = quantity(
        "time constant of a filter on the command, or of the way that it takes to the drive",
        "s",
        CHOSEN,
        default=0.0,
        ge=0,
    )
    speed_feedforward: float = quantity(
        "share of the command's rate that is added to the speed demand", "-", CHOSEN, default=0.0, ge=0, le=2
    )
    speed_feedback: float = quantity(
        "share of the motor's speed that the speed loop compares; 0 for a drive without one",
        "-",
        CHOSEN,
        default=1.0,
        ge=0,
        le=1,
    )
    speed_lag: float = quantity(
        "time constant of the speed feedback: differencing, filtering, sampling",
        "s",
        CHOSEN,
        default=0.0,
        ge=0,
    )


class Motor(Section):
    """Conversion of current to torque; because of power conservation, k_t equals the back-EMF constant."""

    torque_constant: float = quantity(
        "torque constant k_t and back-EMF constant k_e, line to line", "N·m/A", THESIS, gt=0
    )
    saturation: float | None = quantity(
        "fall of both per ampere, k_t (1 - kappa |i|); below 0 where they rise",
        "1/A",
        CHOSEN,
        default=None,
        ge=-1,
        le=1,
    )
    flat_loss: float | None = quantity(
        "by how much the flats of the back-EMF's trapezoid are narrower than 120 degrees, electrical",
        ELECTRICAL_ANGLE,
        CHOSEN,
        default=None,
        ge=0,
        le=2,
    )
    sine_share: float | None = quantity(
        "share of a sine in the shape of the back-EMF, the rest a trapezoid; below 0 where it has a hollow",
        "-",
        CHOSEN,
        default=None,
        ge=-1,
        le=1,
    )
    hall_a: float | None = quantity(
        "electrical angle by which the Hall sensor of phase a switches too early",
        ELECTRICAL_ANGLE,
        CHOSEN,
        default=None,
        ge=-0.4,
        le=0.4,
    )
    hall_b: float | None = quantity(
        "electrical angle by which the Hall sensor of phase b switches too early",
        ELECTRICAL_ANGLE,
        CHOSEN,
        default=None,
        ge=-0.4,
        le=0.4,
    )
    hall_c: float | None = quantity(
        "electrical angle by which the Hall sensor of phase c switches too early",
        ELECTRICAL_ANGLE,
        CHOSEN,
        default=None,
        ge=-0.4,
        le=0.4,
    )
    torque_limit: float | None = quantity(
        "largest torque, T_max; no limit where left out", "N·m", THESIS, default=None, gt=0
    )
    torque_lag: float = quantity(
        "time constant from recorded current to torque: a digital drive's hold, its amplifier",
        "s",
        CHOSEN,
        default=0.0,
        ge=0,
    )


class Electrical(Section):
    """Windings and inverter; an actuator without this section has an ideal current loop."""

    supply: float = quantity("supply voltage, V_dc", "V", THESIS, gt=0)
    resistance: float = quantity("resistance line to line, R_s", "ohm", THESIS, gt=0)
    inductance: float = quantity("inductance line to line, L_s", "H", THESIS, gt=0)
    pole_pairs: int = quantity("pole pairs, P", "-", THESIS, default=1, ge=1, le=1000)
    rotor_zero: float = quantity(
        "electrical angle of the rotor where its angle, or without one the position, is recorded as 0",
        ELECTRICAL_ANGLE,
        CHOSEN,
        default=0.0,
        ge=-6.3,
        le=6.3,
    )
    hysteresis: float | None = quantity(
        "current hysteresis: comparators switch at plus and minus, hb; none where the drive has none",
        "A",
        THESIS,
        default=None,
        gt=0,
    )
    temperature: float = quantity(
        "of windings and magnets where resistance and torque constant hold", "K", CHOSEN, default=293.15, gt=0
    )
    temperature_gain: float | None = quantity(
        "rise of the windings per recorded rise, where the sensor is on the housing; 1 where left out",
        "-",
        CHOSEN,
        default=None,
        gt=0,
        le=100,
    )


class Mechanics(Section):
    """Motor and user, both referred to the motor shaft."""

    inertia_motor: float = quantity("inertia of the motor, J_m", "kg·m²", THESIS, ge=0)
    inertia_user: float = quantity("inertia of the user, J_u", "kg·m²", THESIS, default=0.0, ge=0)
    viscous_motor: float = quantity(
        "viscous friction of the motor, C_m", "N·m·s/rad", THESIS, default=0.0, ge=0
    )
    viscous_user: float = quantity(
        "viscous friction of the user, C_u", "N·m·s/rad", THESIS, default=0.0, ge=0
    )
    static_friction_motor: float = quantity("static friction of the motor, f_sm", "N·m", THESIS, ge=0)
    static_friction_user: float = quantity(
        "static friction of the user, f_su", "N·m", THESIS, default=0.0, ge=0
    )
    dynamic_friction_motor: float = quantity("dynamic friction of the motor, f_dm", "N·m", THESIS, ge=0)
    dynamic_friction_user: float = quantity(
        "dynamic friction of the user, f_du", "N·m", THESIS, default=0.0, ge=0
    )
    backlash: float = quantity("backlash, full width at the motor, BLK", "rad", THESIS, default=0.0, ge=0)
    offset: float = quantity("constant load", "N·m", CHOSEN, default=0.0)
    hinge: float = quantity(
        "load stiffness: load at the motor per position of the user, such as an aerodynamic hinge moment",
        f"N·m/{USER_ANGLE}",
        CHOSEN,
        default=0.0,
    )
    gear_ratio: float = quantity("user motion per motor motion, tau", f"{USER_ANGLE}/rad", CHOSEN, gt=0)
    screw_ratio: float = quantity("turns of the screw per turn of the motor", "-", CHOSEN, default=1.0, gt=0)
    end_stops: tuple[float, float] | None = quantity(
        "end stops at the user, lower and upper; none where left out",
        USER_ANGLE,
        CHOSEN,
        default=None,
        strict=False,
    )

    @property
    def inertia(self) -> float:
        """Total inertia J_m + J_u."""
        return self.inertia_motor + self.inertia_user

    @property
    def viscous(self) -> float:
        """Total viscous friction coefficient C_m + C_u."""
        return self.viscous_motor + self.viscous_user

    @property
    def static_friction(self) -> float:
        """Total static friction f_sm + f_su."""
        return self.static_friction_motor + self.static_friction_user

    @property
    def dynamic_friction(self) -> float:
        """Total dynamic (Coulomb) friction f_dm + f_du."""
        return self.dynamic_friction_motor + self.dynamic_friction_user

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.inertia <= 0:
            raise ValueError("inertia_motor + inertia_user must be greater than 0")
        if self.dynamic_friction > self.static_friction * (1 + 1e-9):
            raise ValueError(
                f"dynamic friction ({self.dynamic_friction:.6g}, motor + user) must not exceed "
                f"static friction ({self.static_friction:.6g})"
            )
        if self.end_stops and not self.end_stops[0] < self.end_stops[1]:
            raise ValueError(f"end_stops {list(self.end_stops)}: give the lower one first")
        return self

    def encloses(self, lowest: float, highest: float) -> bool:
        """Return whether `lowest` to `highest` [rad at the user; m if linear] is within the end stops."""
        if self.end_stops is None:
            return True
        low, high = self.end_stops
        rounding = 1e-9 * (high - low)
        return low - rounding <= lowest and highest <= high + rounding

    def start_for(self, lowest: float, highest: float) -> float:
        """Return the start position of a manoeuvre that moves from `lowest` to `highest` relative to it.

        All positions are in rad at the user, m if linear. The start is 0, or if an end stop is too near to 0,
        the position that centres the manoeuvre in the travel.
        """
        if self.end_stops is None or self.encloses(lowest, highest):
            return 0.0
        return (sum(self.end_stops) - lowest - highest) / 2

    def check_start(self, position: float) -> None:
        """Raise `SignalError` for a `position` [rad at the user; m if linear] beyond the end stops."""
        if not (math.isfinite(position) and self.encloses(position, position)):
            stops = list(self.end_stops or ())
            raise SignalError(
                f"the shaft would rest at {position:g} first, beyond the end stops {stops}; say where it "
                "rests (--about, or initial_position in Python)"
            )


class FaultScales(Section):
    """Scales of the normalised faults in physical quantities (thesis 6.1)."""

    friction: float = quantity("dry friction × (1 + friction × k1)", "-", "thesis 6.1", default=2.0, gt=0)
    backlash: float = quantity("BLK × (1 + backlash × k2)", "-", "thesis 6.1", default=9.0, gt=0)
    eccentricity: float = quantity("Z = eccentricity × k6", "-", "thesis 4.5", default=0.42, gt=0, lt=1)
    gain: float = quantity("G = 1 + gain × (2 k8 - 1)", "-", "thesis 4.6", default=0.5, gt=0, lt=1)
