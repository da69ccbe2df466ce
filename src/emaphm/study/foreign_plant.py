"""A plant that is not our reference model, used only as a source of recordings.

Three phases under hysteresis switching as in the reference model, written anew without the package's kernels.
In addition, each by itself or together: smooth friction after Stribeck, a compliant shaft between motor and
user with the backlash as a dead zone in series, and current sensors that lag, for the drive as for the
recorder. The speed loop is proportional; lags in the loop, load stiffness and end stops are not built.
"""

import math
from typing import Any, NamedTuple

import numba
import numpy as np

from emaphm.actuator import Actuator, Command, Faults
from emaphm.arrays import Array
from emaphm.errors import StudyError
from emaphm.recording import Recording, acquire, full_scales
from emaphm.recording.signal_rows import signal_rows
from emaphm.study.rig import ForeignFeatures

STEP_S = 1e-6
"""Longest integration step [s]: 1/500 of the period of a 2 kHz shaft."""

CHANNELS = (
    "current_A",
    "voltage_V",
    "position_rad",
    "speed_rad_s",
    "angle_rad",
    "current_a_A",
    "current_b_A",
    "current_c_A",
)


class _Parameters(NamedTuple):
    """What the kernel is given, SI units; a pair is motor and user, a triple the phases."""

    gain: float
    speed_limit: float
    speed_gain: float
    current_limit: float
    drive_constant: float
    band: float
    half_supply: float
    pole_pairs: float
    resistance: tuple[float, float, float]
    inductance: tuple[float, float, float]
    flux: tuple[float, float, float]
    eccentricity: float
    direction: float
    torque_limit: float
    inertia: tuple[float, float]
    viscous: tuple[float, float]
    static: tuple[float, float]
    dynamic: tuple[float, float]
    load: float
    half_gap: float
    gear_ratio: float
    stribeck_speed: float
    smoothing: float
    stiffness: float
    damping: float
    sensor_share: float


def simulate(
    actuator: Actuator,
    command: Command,
    features: ForeignFeatures,
    *,
    faults: Faults = Faults(),  # noqa: B008 - frozen
    duration: float = 0.5,
    sample_rate: float = 5000.0,
    noise: float = 0.0,
    adc_bits: int | None = None,
    seed: int = 0,
) -> Recording:
    """Return the recording of the foreign plant following `command` from rest at 0.

    Rows are means over the sample interval, as those of `emaphm.simulate`, whose parameters these are.
    `actuator` has windings and limits of speed and torque; its load is `mechanics.offset`.
    """
    samples = round(duration * sample_rate)
    substeps = int(np.ceil(1 / (sample_rate * STEP_S) * (1 - 1e-9)))
    step = 1 / (sample_rate * substeps)
    out = np.zeros((len(CHANNELS), samples))
    commanded = command(np.asarray(np.arange(samples * substeps) * step))
    _run(_parameters(actuator, faults, features, step), commanded, step, substeps, out)
    time = np.asarray(np.arange(samples) / sample_rate)
    columns = {
        "time_s": time,
        "command_rad": signal_rows(command, time, 1 / sample_rate),
        **dict(zip(CHANNELS, out, strict=True)),
    }
    sensed = dict.fromkeys((name for name in CHANNELS if name.startswith("current")), noise)
    scales = full_scales(actuator) if adc_bits is not None else None
    exact = Recording(columns, source="simulated (foreign plant)")
    return acquire(exact, noise=sensed, adc_bits=adc_bits, full_scale=scales, seed=seed)


def _parameters(actuator: Actuator, faults: Faults, features: ForeignFeatures, step: float) -> _Parameters:
    c, e, m, motor = actuator.controller, actuator.electrical, actuator.mechanics, actuator.motor
    if e is None or e.hysteresis is None or c.speed_limit is None or motor.torque_limit is None:
        raise StudyError(
            f"actuator '{actuator.name}': the foreign plant needs its electrical description and its limits "
            "of speed and torque; add them, or leave out 'foreign'"
        )
    physical = faults.physical(actuator)
    turns = [max(physical[f"turns_{phase}"], 0.01) for phase in "abc"]
    friction, shaft = features.friction, features.shaft
    more = physical["friction_factor"]
    return _Parameters(
        gain=physical["gain_factor"] * c.position_gain,
        speed_limit=c.speed_limit,
        speed_gain=c.speed_gain,
        current_limit=c.current_limit,
        drive_constant=actuator.drive_constant,
        band=e.hysteresis,
        half_supply=e.supply / 2,
        pole_pairs=float(e.pole_pairs),
        resistance=_three([e.resistance / 2 * n for n in turns]),
        inductance=_three([e.inductance / 2 * n * n for n in turns]),
        flux=_three([motor.torque_constant / 2 * n for n in turns]),
        eccentricity=physical["eccentricity_Z"],
        direction=physical["eccentricity_phase_rad"],
        torque_limit=motor.torque_limit,
        inertia=(m.inertia_motor, m.inertia_user),
        viscous=(m.viscous_motor, m.viscous_user),
        static=(more * m.static_friction_motor, more * m.static_friction_user),
        dynamic=(more * m.dynamic_friction_motor, more * m.dynamic_friction_user),
        load=m.offset,
        half_gap=physical["backlash_rad"] / 2,
        gear_ratio=m.gear_ratio,
        stribeck_speed=friction.speed if friction else 0.0,
        smoothing=friction.smoothing if friction else 0.0,
        stiffness=shaft.stiffness if shaft else 0.0,
        damping=shaft.damping if shaft else 0.0,
        sensor_share=-float(np.expm1(-step / features.sensor_lag)) if features.sensor_lag else 1.0,
    )


def _three(values: list[float]) -> tuple[float, float, float]:
    a, b, c = values
    return a, b, c


def _compiled(function: Any) -> Any:
    return numba.njit(cache=True, error_model="numpy")(function)


@_compiled
def trapezoid(angle: float) -> float:
    """Return the unit trapezoid at an electrical angle in [0, 2 pi)."""
    ramp = np.pi / 6
    if angle < ramp:
        return angle / ramp
    if angle <= 5 * ramp:
        return 1.0
    if angle < 7 * ramp:
        return (6 * ramp - angle) / ramp
    if angle <= 11 * ramp:
        return -1.0
    return (angle - 12 * ramp) / ramp


@_compiled
def commutation(angle: float) -> float:
    """Return the sign of the flat that an electrical angle in [0, 2 pi) lies on, 0 on a ramp."""
    ramp = np.pi / 6
    if ramp <= angle <= 5 * ramp:
        return 1.0
    if 7 * ramp <= angle <= 11 * ramp:
        return -1.0
    return 0.0


@_compiled
def stribeck_torque(w: float, static: float, dynamic: float, speed: float, smoothing: float) -> float:
    """Return the smooth friction torque [N·m] at speed `w` [rad/s]."""
    return (dynamic + (static - dynamic) * math.exp(-((w / speed) ** 2))) * math.tanh(w / smoothing)


@_compiled
def shaft_torque(twist: float, rate: float, half_gap: float, stiffness: float, damping: float) -> float:
    """Return what the motor passes to the user [N·m], `twist` [rad] and its `rate` [rad/s] ahead of it.

    Nothing inside the gap; at its edge spring and damper, which push but do not pull.
    """
    if twist > half_gap:
        return max(stiffness * (twist - half_gap) + damping * rate, 0.0)
    if twist < -half_gap:
        return min(stiffness * (twist + half_gap) + damping * rate, 0.0)
    return 0.0


@_compiled
def speed_after(
    w: float,
    torque: float,
    inertia: float,
    static: float,
    dynamic: float,
    stribeck_speed: float,
    smoothing: float,
    step: float,
) -> float:
    """Return the speed [rad/s] of an inertia after a step under `torque` [N·m] and its friction.

    Stribeck's where there is a `stribeck_speed`, else Borello's: sticking up to `static`, breaking away
    against `dynamic`, and stopping at 0 before going the other way.
    """
    if stribeck_speed > 0:
        friction: float = stribeck_torque(w, static, dynamic, stribeck_speed, smoothing)
        return w + (torque - friction) * step / inertia
    if w == 0.0:
        if abs(torque) <= static:
            return 0.0
        return (torque - math.copysign(dynamic, torque)) * step / inertia
    following: float = w + (torque - math.copysign(dynamic, w)) * step / inertia
    return 0.0 if following * w < 0 else following


@_compiled
def move(
    p: Any, torque: float, w: float, theta: float, user_w: float, user: float, step: float
) -> tuple[float, float, float, float]:
    """Return speed and angle of motor and of user after a step under the motor's `torque` [N·m]."""
    if p.stiffness > 0:
        passed = shaft_torque(theta - user, w - user_w, p.half_gap, p.stiffness, p.damping)
        driven = torque - passed - p.viscous[0] * w
        pulled = passed - p.load - p.viscous[1] * user_w
        w = speed_after(
            w, driven, p.inertia[0], p.static[0], p.dynamic[0], p.stribeck_speed, p.smoothing, step
        )
        user_w = speed_after(
            user_w, pulled, p.inertia[1], p.static[1], p.dynamic[1], p.stribeck_speed, p.smoothing, step
        )
        return w, theta + w * step, user_w, user + user_w * step
    active = torque - p.load - (p.viscous[0] + p.viscous[1]) * w
    inertia, static = p.inertia[0] + p.inertia[1], p.static[0] + p.static[1]
    dynamic = p.dynamic[0] + p.dynamic[1]
    w = speed_after(w, active, inertia, static, dynamic, p.stribeck_speed, p.smoothing, step)
    theta += w * step
    return w, theta, w, min(max(user, theta - p.half_gap), theta + p.half_gap)


@_compiled
def _run(p: Any, command: Array, step: float, substeps: int, out: Array) -> None:
    """Fill `out` (channels, samples) with means over each interval."""
    i, sensed, legs = np.zeros(3), np.zeros(3), np.full(3, -1.0)
    shape, sign, flux, drive = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    admittance = 1 / p.inductance[0] + 1 / p.inductance[1] + 1 / p.inductance[2]
    w = theta = user_w = user = 0.0
    for now in range(command.size):
        demand = min(max(p.gain * (command[now] - p.gear_ratio * user), -p.speed_limit), p.speed_limit)
        reference = p.speed_gain * (demand - w) / p.drive_constant
        reference = min(max(reference, -p.current_limit), p.current_limit)
        centre = 0.0
        for phase in range(3):
            electrical = (p.pole_pairs * theta - 2 * np.pi / 3 * phase) % (2 * np.pi)
            shape[phase], sign[phase] = trapezoid(electrical), commutation(electrical)
            missing = reference * sign[phase] - sensed[phase]
            if missing > p.band:
                legs[phase] = 1.0
            elif missing < -p.band:
                legs[phase] = -1.0
            gap = 1 + p.eccentricity * np.cos(theta + p.direction + 2 * np.pi / 3 * phase)
            flux[phase] = p.flux[phase] * gap * shape[phase]
            drive[phase] = legs[phase] * p.half_supply - p.resistance[phase] * i[phase] - flux[phase] * w
            centre += drive[phase] / p.inductance[phase] / admittance
        torque = equivalent = voltage = 0.0
        for phase in range(3):
            i[phase] += (drive[phase] - centre) / p.inductance[phase] * step
            sensed[phase] += p.sensor_share * (i[phase] - sensed[phase])
            torque += flux[phase] * i[phase]
            equivalent += 0.5 * shape[phase] * sensed[phase]
            voltage += sign[phase] * legs[phase] * p.half_supply
        torque = min(max(torque, -p.torque_limit), p.torque_limit)
        w, theta, user_w, user = move(p, torque, w, theta, user_w, user, step)
        row = now // substeps
        out[0, row] += equivalent / substeps
        out[1, row] += voltage / substeps
        out[2, row] += p.gear_ratio * user / substeps
        out[3, row] += w / substeps
        out[4, row] += theta / substeps
        for phase in range(3):
            out[5 + phase, row] += sensed[phase] / substeps
