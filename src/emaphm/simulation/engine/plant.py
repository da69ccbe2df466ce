"""Plants: the physical quantities of the actuators of a batch as arrays, with their faults applied."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from emaphm.actuator import Actuator
from emaphm.actuator.faults import NAMES, SHORTEST_WINDING, check_vectors
from emaphm.actuator.lumped_parameters import check_lumped_parameters, static_follows
from emaphm.actuator.parameters import Controller
from emaphm.actuator.unit.baseline import COMMUTATION, HALL_SENSORS, SECTIONS
from emaphm.actuator.unit.baseline import SIGNED as OF_EITHER_SIGN
from emaphm.arrays import Array
from emaphm.errors import FaultError, MethodError
from emaphm.identity_cache import cached_by_identity
from emaphm.simulation.engine.structure import Ripple, Structure
from emaphm.simulation.laws.load_steps import STEP_PARTS, STEP_PREFIX
from emaphm.simulation.laws.load_variation import PREFIX

NO_LIMIT = 1e30
"""Value of an absent limit; the kernels are compiled under the assumption that all numbers are finite."""

NEVER_ZERO = (
    "inertia",
    "position_gain",
    "speed_gain",
    "torque_constant",
    "resistance",
    "inductance",
    "supply",
    "stiffness",
    "stribeck_speed",
    "transition_speed",
    "presliding_stiffness",
)

SIGNED = (*OF_EITHER_SIGN, "hinge")

OF_POSITION_PID = (
    "position_integral_gain",
    "position_derivative_gain",
    "command_lag",
    "speed_feedforward",
    "speed_feedback",
)
"""Quantities of the PID position controller that the proportional position loop does not have."""

FRICTIONS = (
    "coulomb",
    "static",
    "load_friction",
    "load_motor",
    "load_external",
    "stribeck_load_motor",
    "stribeck_load_external",
)
"""Quantities that a friction fault multiplies."""


@dataclass(frozen=True)
class Plant:
    """Quantities of `n` actuators in SI units, each of shape (n,) unless stated otherwise.

    Friction, backlash and position gain include their faults. The windings are given by the healthy
    line-to-line values and `turns` (3, n), the fraction of healthy turns in each phase. `z` (2, n) is
    Z (cos φ, sin φ). `ripples` (2 × harmonics, n) are the amplitudes of cosine and sine of each harmonic.
    `load_variation` (coefficients, n) are the coefficients of a varying load, `load_steps` (steps, 3, n) are
    size, time and rise time of each load step. `structure` defines which optional laws are used; the values
    of unused laws have no effect.
    """

    inertia: Array
    viscous: Array
    coulomb: Array
    static: Array
    offset: Array
    hinge: Array
    backlash: Array
    gear_ratio: Array
    low_stop: Array
    high_stop: Array
    position_gain: Array
    speed_gain: Array
    integral_gain: Array
    derivative_gain: Array
    speed_limit: Array
    current_limit: Array
    drive_constant: Array
    speed_lag: Array
    torque_constant: Array
    saturation: Array
    flat_loss: Array
    sine_share: Array
    hall_a: Array
    hall_b: Array
    hall_c: Array
    torque_limit: Array
    torque_lag: Array
    supply: Array
    resistance: Array
    inductance: Array
    hysteresis: Array
    pole_pairs: Array
    rotor_zero: Array
    turns: Array
    z: Array
    structure: Structure
    position_integral_gain: Array
    position_derivative_gain: Array
    command_lag: Array
    speed_feedforward: Array
    speed_feedback: Array
    current_gain: Array
    current_integral_gain: Array
    pwm_frequency: Array
    source_resistance: Array
    voltage_drop: Array
    current_lag: Array
    commutation_lag: Array
    commutation_delay: Array
    stribeck_speed: Array
    load_friction: Array
    load_motor: Array
    load_external: Array
    stribeck_load_motor: Array
    stribeck_load_external: Array
    coulomb_asymmetry: Array
    viscous_asymmetry: Array
    quadratic: Array
    transition_speed: Array
    presliding_stiffness: Array
    presliding_damping: Array
    viscous_temperature: Array
    temperature_gain: Array
    stiffness: Array
    damping: Array
    user_share_of_inertia: Array
    user_share_of_viscous: Array
    user_share_of_static: Array
    user_share_of_coulomb: Array
    gravity: Array
    gravity_angle: Array
    screw_ratio: Array
    ripples: Array
    load_variation: Array
    load_steps: Array

    @staticmethod
    def of(
        actuator: Actuator, faults: ArrayLike, lumped_parameters: Mapping[str, ArrayLike] | None = None
    ) -> "Plant":
        """Return the plants of `actuator` under `faults`.

        Parameters
        ----------
        faults
            Normalised fault vectors, shape (n, 8).
        lumped_parameters
            Values that replace those of the actuator, by their names in `LUMPED_PARAMETERS`, each of shape
            (n,) or a scalar; friction faults multiply them. In addition, the coefficients of a varying load,
            named by `coefficient_names`, and load steps, named by `step_names`.

        Raises
        ------
        FaultError
            `faults` has another shape, or a value outside the range of the actuator.
        MethodError
            A parameter is unknown or out of range, has another shape, or needs the electrical description,
            which the actuator lacks.
        """
        k = np.atleast_2d(np.asarray(faults, float))
        if k.ndim != 2 or k.shape[1] != len(NAMES):
            raise FaultError(f"fault vectors have shape (n, {len(NAMES)}), got {np.shape(faults)}")
        check_vectors(k, actuator)
        columns = _healthy(actuator, len(k))
        given = dict(lumped_parameters or {})
        varying, steps = (
            _rows([given.pop(name) for name in list(given) if name.startswith(prefix)], len(k))
            for prefix in (PREFIX, STEP_PREFIX)
        )
        _set_lumped_parameters(columns, actuator, given)
        _apply_faults(columns, actuator, k)
        steps = steps.reshape(len(steps) // len(STEP_PARTS), len(STEP_PARTS), len(k))
        columns |= {"load_variation": varying, "load_steps": steps}
        described = structure_of(actuator)
        structure = described._replace(
            # A given parameter activates its law, even if the description lacks the law.
            position_pid=described.position_pid or any(name in given for name in OF_POSITION_PID),
            load_variation=len(varying),
            load_steps=len(steps),
        )
        return Plant(**columns, structure=structure)

    @property
    def count(self) -> int:
        """Number of actuators, n."""
        return int(self.inertia.size)


def _rows(values: Sequence[ArrayLike], n: int) -> Array:
    """Return `values`, a scalar or (n,) each, as an array (rows, n)."""
    rows = np.zeros((len(values), n))
    for row, value in zip(rows, values, strict=True):
        row[:] = value
    return rows


def _healthy(actuator: Actuator, n: int) -> dict[str, Array]:
    """Return the quantities of `Plant` for `n` healthy actuators."""
    names, values, amplitudes = _described(actuator)
    return {
        **dict(zip(names, np.repeat(values, n, axis=1), strict=True)),
        "turns": np.ones((3, n)),
        "z": np.zeros((2, n)),
        "ripples": np.repeat(amplitudes, n, axis=1),
    }


@cached_by_identity
def _described(actuator: Actuator) -> tuple[tuple[str, ...], Array, Array]:
    """Return names and values (quantities, 1) of the scalars of `Plant`, and the `ripples` (rows, 1)."""
    m, c, motor, e = actuator.mechanics, actuator.controller, actuator.motor, actuator.electrical
    low, high = m.end_stops or (-NO_LIMIT, NO_LIMIT)
    scalars = {
        "inertia": m.inertia,
        "viscous": m.viscous,
        "coulomb": m.dynamic_friction,
        "static": m.static_friction,
        "offset": m.offset,
        "hinge": m.hinge,
        "backlash": m.backlash,
        "gear_ratio": m.gear_ratio,
        "low_stop": low / m.gear_ratio,
        "high_stop": high / m.gear_ratio,
        "position_gain": c.position_gain,
        "speed_gain": c.speed_gain,
        "integral_gain": c.integral_gain,
        "derivative_gain": c.derivative_gain,
        "speed_limit": c.speed_limit or NO_LIMIT,
        "current_limit": c.current_limit,
        "drive_constant": actuator.drive_constant,
        "speed_lag": c.speed_lag,
        "torque_constant": motor.torque_constant,
        "saturation": motor.saturation or 0.0,
        "flat_loss": motor.flat_loss or 0.0,
        "sine_share": motor.sine_share or 0.0,
        **{name: getattr(motor, name) or 0.0 for name in HALL_SENSORS},
        "torque_limit": motor.torque_limit or NO_LIMIT,
        "torque_lag": motor.torque_lag,
        # Ideal current loop: the supply can drive any current within a step.
        "supply": e.supply if e else 1e12,
        "resistance": e.resistance if e else 1.0,
        "inductance": e.inductance if e else 1e-12,
        "hysteresis": (e.hysteresis or 0.0) if e else 0.0,
        "temperature_gain": (e.temperature_gain or 0.0) if e else 0.0,
        "pole_pairs": e.pole_pairs if e else 1,
        "rotor_zero": e.rotor_zero if e else 0.0,
        "position_integral_gain": c.position_integral_gain,
        "position_derivative_gain": c.position_derivative_gain,
        "command_lag": c.command_lag,
        "speed_feedforward": c.speed_feedforward,
        "speed_feedback": c.speed_feedback,
        "pwm_frequency": (actuator.drive.pwm_frequency or 0.0) if actuator.drive else 0.0,
        "user_share_of_inertia": m.inertia_user / m.inertia,
        "user_share_of_viscous": m.viscous_user / m.viscous if m.viscous else 0.0,
        "user_share_of_static": m.static_friction_user / m.static_friction if m.static_friction else 0.0,
        "user_share_of_coulomb": m.dynamic_friction_user / m.dynamic_friction if m.dynamic_friction else 0.0,
        "screw_ratio": m.screw_ratio,
        **_of_optional_laws(actuator),
    }
    amplitudes = [value for ripple in actuator.ripple for value in (ripple.cos, ripple.sin)]
    values = np.array(list(scalars.values()), float)
    return tuple(scalars), values[:, np.newaxis], np.array(amplitudes)[:, np.newaxis]


def _of_optional_laws(actuator: Actuator) -> dict[str, float]:
    """Return the values of all optional laws; 0 for laws that are not described."""
    values = {}
    for section in ("drive", "friction", "transmission", "weight"):
        described = getattr(actuator, section)
        for name in SECTIONS[section]:
            values[name] = (getattr(described, name) or 0.0) if described is not None else 0.0
    return values


@cached_by_identity
def structure_of(actuator: Actuator) -> Structure:
    """Return the structure of `actuator`: its drive and the optional laws whose values are described."""
    c, friction, drive = actuator.controller, actuator.friction, actuator.drive

    def described(*names: str) -> bool:
        return friction is not None and any(getattr(friction, name) is not None for name in names)

    return Structure(
        drive=actuator.drive_kind,
        position_pid=any(
            getattr(c, name) != Controller.model_fields[name].default for name in OF_POSITION_PID
        ),
        stribeck=described("stribeck_speed"),
        load_dependent=described(
            "load_friction", "load_motor", "load_external", "stribeck_load_motor", "stribeck_load_external"
        ),
        directional=described("coulomb_asymmetry", "viscous_asymmetry"),
        quadratic=described("quadratic"),
        transition=described("transition_speed"),
        presliding=described("presliding_stiffness"),
        compliance=actuator.transmission is not None,
        gravity=actuator.weight is not None,
        source=drive is not None and drive.source_resistance is not None,
        current_lag=drive is not None and drive.current_lag is not None,
        voltage_drop=drive is not None and drive.voltage_drop is not None,
        saturation=actuator.motor.saturation is not None,
        emf_shape=actuator.motor.flat_loss is not None or actuator.motor.sine_share is not None,
        commutation=any(getattr(actuator.motor, name) is not None for name in HALL_SENSORS)
        or any(getattr(drive, name, None) is not None for name in COMMUTATION),
        ripples=tuple(Ripple(ripple.order, ripple.of == "screw") for ripple in actuator.ripple),
    )


def _set_lumped_parameters(
    columns: dict[str, Array], actuator: Actuator, lumped_parameters: Mapping[str, ArrayLike]
) -> None:
    check_lumped_parameters(actuator, lumped_parameters)
    count = columns["inertia"].size
    for name, values in static_follows(actuator, lumped_parameters).items():
        column = np.asarray(values, float)
        if column.shape not in {(), (count,)}:
            raise MethodError(f"parameter '{name}' has shape {column.shape}; give one value, or {count}")
        if not np.isfinite(column).all() or (name not in SIGNED and (column < 0).any()):
            raise MethodError(f"parameter '{name}' must be finite and not negative; correct its value")
        if name in NEVER_ZERO and (column == 0).any():
            raise MethodError(f"parameter '{name}' must be greater than 0; correct its value")
        _column_of(name, columns)[:] = column
    # With static below dynamic friction, the dynamic friction would push back a shaft that breaks away.
    np.maximum(columns["static"], columns["coulomb"], out=columns["static"])


def _column_of(name: str, columns: dict[str, Array]) -> Array:
    """Return the column of a lumped parameter; a ripple, such as `ripple2_sin`, is a row of `ripples`."""
    if not name.startswith("ripple"):
        return columns[name]
    place, part = name.removeprefix("ripple").split("_")
    return np.asarray(columns["ripples"][2 * (int(place) - 1) + (part == "sin")])


def _apply_faults(columns: dict[str, Array], actuator: Actuator, k: Array) -> None:
    scales = actuator.faults
    friction = 1 + scales.friction * k[:, 0]
    phase = (2 * k[:, 6] - 1) * np.pi
    for name in FRICTIONS:
        columns[name] *= friction
    columns["backlash"] *= 1 + scales.backlash * k[:, 1]
    columns["turns"] = np.maximum(1 - k[:, 2:5].T, SHORTEST_WINDING)
    columns["z"] = scales.eccentricity * k[:, 5] * np.stack([np.cos(phase), np.sin(phase)])
    columns["position_gain"] *= 1 + scales.gain * (2 * k[:, 7] - 1)
