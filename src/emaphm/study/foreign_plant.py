"""An independent plant model, different from the reference model, that is used only to simulate recordings.

Three phases under hysteresis switching as in the reference model, implemented without the package's kernels.
Optional features, alone or combined: smooth Stribeck friction, or bristle friction; a compliant shaft between
motor and user with the backlash as a dead zone in series; a back-EMF that is not a perfect trapezoid;
displaced Hall sensors, or Hall sensors with hysteresis; late commutation; and current sensors with a lag, for
drive and recorder. The speed loop is proportional; lags in the loop, load stiffness and end stops are not
modelled.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numba
import numpy as np

from emaphm.actuator import Actuator, Command, Faults
from emaphm.actuator.commands import rest_position
from emaphm.arrays import Array
from emaphm.errors import StudyError
from emaphm.recording import Recording, acquire, full_scales
from emaphm.recording.signal_rows import signal_rows
from emaphm.study.rig import Bristles, ForeignFeatures, Stribeck

Triple = tuple[float, float, float]

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
    """Parameters of the kernel in SI units; triples are of the phases, or of motor, user and both lumped.

    `bristles` are the stiffness and the damping of the bristles of motor, user and both lumped.
    """

    gain: float
    speed_limit: float
    speed_gain: float
    current_limit: float
    drive_constant: float
    band: float
    half_supply: float
    pole_pairs: float
    resistance: Triple
    inductance: Triple
    flux: Triple
    ramp: float
    sine: float
    hall: Triple
    hall_band: float
    commutation_delay: float
    eccentricity: float
    direction: float
    torque_limit: float
    inertia: Triple
    viscous: Triple
    static: Triple
    dynamic: Triple
    bristles: tuple[Triple, Triple]
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
    """Return the recording of the foreign plant as it follows `command` from rest at its initial position.

    Parameters as for `emaphm.simulate`; rows are means over the sample interval, as there. The description
    `actuator` must have windings and limits of speed and torque; its load is `mechanics.offset`.
    """
    samples = round(duration * sample_rate)
    substeps = int(np.ceil(1 / (sample_rate * STEP_S) * (1 - 1e-9)))
    step = 1 / (sample_rate * substeps)
    out = np.zeros((len(CHANNELS), samples))
    commanded = command(np.asarray(np.arange(samples * substeps) * step))
    start = rest_position(command) / actuator.mechanics.gear_ratio
    _run(_parameters(actuator, faults, features, step), start, commanded, step, substeps, out)
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
    friction, shaft, shape = features.friction, features.shaft, features.back_emf
    static = _parts(m.static_friction_motor, m.static_friction_user)
    dynamic = _parts(m.dynamic_friction_motor, m.dynamic_friction_user)
    inertia, more = _parts(m.inertia_motor, m.inertia_user), physical["friction_factor"]
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
        ramp=np.radians(180 - shape.flat) / 2,
        sine=shape.sine,
        hall=_three(np.radians(features.hall)),
        hall_band=math.radians(features.hall_hysteresis),
        commutation_delay=features.commutation_delay,
        eccentricity=physical["eccentricity_Z"],
        direction=physical["eccentricity_phase_rad"],
        torque_limit=motor.torque_limit,
        inertia=inertia,
        viscous=_parts(m.viscous_motor, m.viscous_user),
        static=_three([more * level for level in static]),
        dynamic=_three([more * level for level in dynamic]),
        bristles=_bristles(friction, static, inertia),
        load=m.offset,
        half_gap=physical["backlash_rad"] / 2,
        gear_ratio=m.gear_ratio,
        stribeck_speed=friction.speed if friction else 0.0,
        smoothing=friction.smoothing if isinstance(friction, Stribeck) else 0.0,
        stiffness=shaft.stiffness if shaft else 0.0,
        damping=shaft.damping if shaft else 0.0,
        sensor_share=-float(np.expm1(-step / features.sensor_lag)) if features.sensor_lag else 1.0,
    )


def _bristles(friction: Stribeck | Bristles | None, static: Triple, inertia: Triple) -> tuple[Triple, Triple]:
    """Return stiffness [N·m/rad] and damping [N·m·s/rad] of the bristles, with equal bends of all parts."""
    if not isinstance(friction, Bristles):
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    stiffness = _three([level / friction.bend for level in static])
    critical = [2 * math.sqrt(k * j) for k, j in zip(stiffness, inertia, strict=True)]
    return stiffness, _three([friction.damping * value for value in critical])


def _parts(motor: float, user: float) -> Triple:
    return motor, user, motor + user


def _three(values: Sequence[float] | Array) -> Triple:
    a, b, c = values
    return float(a), float(b), float(c)


def _compiled(function: Any) -> Any:
    return numba.njit(cache=True, error_model="numpy")(function)


@_compiled
def trapezoid(angle: float, ramp: float) -> float:
    """Return the unit trapezoid at an electrical angle in [0, 2 pi), with `ramp` [rad] from zero to flat."""
    half = angle % np.pi
    level: float = min(min(half, np.pi - half) / ramp, 1.0)
    return level if angle < np.pi else -level


@_compiled
def back_emf(angle: float, ramp: float, sine: float) -> float:
    """Return the back-EMF of a phase per flux: a trapezoid and a sine of the same line-to-line peak."""
    part = sine * 2 / math.sqrt(3) * math.sin(angle)
    shape: float = (1 - sine) * trapezoid(angle, ramp) + part
    return shape


@_compiled
def commutation(electrical: float, hall: Any, band: float, high: Array, sign: Array) -> None:
    """Update the Hall states `high` (3,) and the signs of the phase currents `sign` (3,), 0 if idle.

    The Hall sensor of a phase is high over the half turn that begins with its flat, `hall` [rad] early;
    within `band` [rad] of an edge it keeps its state. A phase conducts while its sensor and the next one
    differ.
    """
    for phase in range(3):
        own = (electrical - 2 * np.pi / 3 * phase - np.pi / 6 + hall[phase]) % (2 * np.pi)
        if own % np.pi >= band and own % np.pi <= np.pi - band:
            high[phase] = 1.0 if own < np.pi else 0.0
    for phase in range(3):
        sign[phase] = high[phase] - high[(phase + 1) % 3]


@_compiled
def sliding_level(w: float, static: float, dynamic: float, speed: float) -> float:
    """Return the level of Stribeck friction [N·m] at speed `w` [rad/s]."""
    level: float = dynamic + (static - dynamic) * math.exp(-((w / speed) ** 2))
    return level


@_compiled
def stribeck_torque(w: float, static: float, dynamic: float, speed: float, smoothing: float) -> float:
    """Return the smooth friction torque [N·m] at speed `w` [rad/s]."""
    torque: float = sliding_level(w, static, dynamic, speed) * math.tanh(w / smoothing)
    return torque


@_compiled
def shaft_torque(twist: float, rate: float, half_gap: float, stiffness: float, damping: float) -> float:
    """Return the torque from motor to user [N·m], from the `twist` [rad] of the shaft and its `rate` [rad/s].

    Zero inside the gap; at its edge a spring and a damper, which push but do not pull.
    """
    if twist > half_gap:
        return max(stiffness * (twist - half_gap) + damping * rate, 0.0)
    if twist < -half_gap:
        return min(stiffness * (twist + half_gap) + damping * rate, 0.0)
    return 0.0


@_compiled
def against_dry_friction(w: float, torque: float, inertia: float, p: Any, part: int, step: float) -> float:
    """Return the speed [rad/s] after a step under `torque` [N·m] and Stribeck friction, or else Borello's.

    Borello friction sticks up to its static level, breaks away against its dynamic level, and stops at 0
    before a reversal.
    """
    static, dynamic = p.static[part], p.dynamic[part]
    if p.stribeck_speed > 0:
        friction: float = stribeck_torque(w, static, dynamic, p.stribeck_speed, p.smoothing)
        return w + (torque - friction) * step / inertia
    if w == 0.0:
        if abs(torque) <= static:
            return 0.0
        return (torque - math.copysign(dynamic, torque)) * step / inertia
    following: float = w + (torque - math.copysign(dynamic, w)) * step / inertia
    return 0.0 if following * w < 0 else following


@_compiled
def against_bristles(
    w: float, torque: float, inertia: float, p: Any, part: int, bend: Array, step: float
) -> float:
    """Return the speed [rad/s] after a step under `torque` [N·m] and bristle friction (LuGre); update `bend`.

    z' = w - k |w| z / level; the friction torque is k z + c z'.
    """
    stiffness, damping = p.bristles[0][part], p.bristles[1][part]
    sliding = sliding_level(w, p.static[part], p.dynamic[part], p.stribeck_speed) / stiffness
    # Exact for this speed: stiff bristles reach their level in much less than a step.
    bent = (math.copysign(sliding, w) - bend[part]) * -math.expm1(-abs(w) / sliding * step)
    bend[part] += bent
    following: float = w + (torque - stiffness * bend[part] - damping * bent / step) * step / inertia
    return following


@_compiled
def speed_after(w: float, torque: float, p: Any, part: int, bend: Array, step: float) -> float:
    """Return the speed [rad/s] of `part` after a step under `torque` [N·m] and its friction."""
    inertia = p.inertia[part]
    has_bristles = p.bristles[0][part] > 0
    following: float = (
        against_bristles(w, torque, inertia, p, part, bend, step)
        if has_bristles
        else against_dry_friction(w, torque, inertia, p, part, step)
    )
    return following


@_compiled
def move(
    p: Any, torque: float, w: float, theta: float, user_w: float, user: float, bend: Array, step: float
) -> tuple[float, float, float, float]:
    """Return speed and angle of motor and user after a step under the motor's `torque` [N·m].

    `bend` (3,), the bend of the bristles of motor, user and both lumped, is updated.
    """
    if p.stiffness > 0:
        passed = shaft_torque(theta - user, w - user_w, p.half_gap, p.stiffness, p.damping)
        driven = torque - passed - p.viscous[0] * w
        pulled = passed - p.load - p.viscous[1] * user_w
        w = speed_after(w, driven, p, 0, bend, step)
        user_w = speed_after(user_w, pulled, p, 1, bend, step)
        return w, theta + w * step, user_w, user + user_w * step
    w = speed_after(w, torque - p.load - p.viscous[2] * w, p, 2, bend, step)
    theta += w * step
    return w, theta, w, min(max(user, theta - p.half_gap), theta + p.half_gap)


@_compiled
def _run(p: Any, start: float, command: Array, step: float, substeps: int, out: Array) -> None:
    """Fill `out` (channels, samples) with means over each interval, from rest at `start` [rad]."""
    i, sensed, legs, bend = np.zeros(3), np.zeros(3), np.full(3, -1.0), np.zeros(3)
    shape, sign, flux, drive = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    admittance = 1 / p.inductance[0] + 1 / p.inductance[1] + 1 / p.inductance[2]
    w = user_w = 0.0
    theta = user = start
    high = np.zeros(3)
    commutation(p.pole_pairs * start, p.hall, 0.0, high, sign)
    for now in range(command.size):
        demand = min(max(p.gain * (command[now] - p.gear_ratio * user), -p.speed_limit), p.speed_limit)
        reference = p.speed_gain * (demand - w) / p.drive_constant
        reference = min(max(reference, -p.current_limit), p.current_limit)
        centre = 0.0
        commutation(p.pole_pairs * (theta - p.commutation_delay * w), p.hall, p.hall_band, high, sign)
        for phase in range(3):
            electrical = (p.pole_pairs * theta - 2 * np.pi / 3 * phase) % (2 * np.pi)
            shape[phase] = trapezoid(electrical, np.pi / 6)
            missing = reference * sign[phase] - sensed[phase]
            if missing > p.band:
                legs[phase] = 1.0
            elif missing < -p.band:
                legs[phase] = -1.0
            gap = 1 + p.eccentricity * np.cos(theta + p.direction + 2 * np.pi / 3 * phase)
            flux[phase] = p.flux[phase] * gap * back_emf(electrical, p.ramp, p.sine)
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
        w, theta, user_w, user = move(p, torque, w, theta, user_w, user, bend, step)
        row = now // substeps
        out[0, row] += equivalent / substeps
        out[1, row] += voltage / substeps
        out[2, row] += p.gear_ratio * user / substeps
        out[3, row] += w / substeps
        out[4, row] += theta / substeps
        for phase in range(3):
            out[5 + phase, row] += sensed[phase] / substeps
