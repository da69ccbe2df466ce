"""An independent reference model: scalar Python, written only from docs/physics.md, section 3."""

import math
from collections.abc import Callable

import numpy as np

from emaphm.actuator import Actuator, Faults
from emaphm.arrays import Array


def trapezoid(degrees: float) -> float:
    """Return s at an electrical angle [deg], as the polyline of docs/physics.md."""
    return float(np.interp(degrees % 360.0, [0.0, 30.0, 150.0, 210.0, 330.0, 360.0], [0, 1, 1, -1, -1, 0]))


def demand(degrees: float) -> int:
    """Return r at an electrical angle [deg]: +1 from 30 to 150, -1 from 210 to 330, else 0."""
    turned = degrees % 360.0
    if 30.0 <= turned <= 150.0:
        return 1
    return -1 if 210.0 <= turned <= 330.0 else 0


def simulate(  # noqa: PLR0915 - one step, in the order of docs/physics.md
    actuator: Actuator,
    faults: Faults,
    command: Callable[[float], float],
    steps: int,
    *,
    load: float = 0.0,
    rotor_offset: float = 0.0,
    dt: float = 1e-6,
) -> dict[str, Array]:
    """Return all channels after each step. All legs start low."""
    e, c, m = actuator.electrical, actuator.controller, actuator.mechanics
    assert e is not None
    assert e.hysteresis is not None
    assert c.speed_limit is not None
    assert actuator.motor.torque_limit is not None
    assert m.end_stops is not None
    k1, k2, ka, kb, kc, k6, k7, k8 = (float(k) for k in faults.vector)
    turns = [max(1 - k, 0.01) for k in (ka, kb, kc)]
    R = [e.resistance / 2 * n for n in turns]
    L = [e.inductance / 2 * n * n for n in turns]
    Z, phi = 0.42 * k6, (2 * k7 - 1) * math.pi
    gain = (0.5 + k8) * c.position_gain
    static, dynamic = m.static_friction * (1 + 2 * k1), m.dynamic_friction * (1 + 2 * k1)
    gap = m.backlash * (1 + 9 * k2)
    low, high = (stop / m.gear_ratio for stop in m.end_stops)

    i, legs = [0.0, 0.0, 0.0], [-1, -1, -1]
    theta = w = sensed_speed = felt = output = integral = 0.0
    previous: float | None = None
    # Speed feedback and torque may have a lag.
    speed_decay, torque_decay = (
        math.exp(-dt / lag) if lag else 0.0 for lag in (c.speed_lag, actuator.motor.torque_lag)
    )
    trace = []
    for n in range(steps):
        # 1. Controller.
        wanted = gain * (command(n * dt) - m.gear_ratio * output)
        sensed_speed = w + (sensed_speed - w) * speed_decay
        error = min(max(wanted, -c.speed_limit), c.speed_limit) - sensed_speed
        slope = 0.0 if previous is None else (error - previous) / dt
        demanded_torque = c.speed_gain * error + c.integral_gain * integral + c.derivative_gain * slope
        reference = min(max(demanded_torque / actuator.drive_constant, -c.current_limit), c.current_limit)
        integral += error * dt
        previous = error
        # 2, 3. Commutation and switching.
        rotor = theta + rotor_offset
        electrical = [math.degrees(e.pole_pairs * rotor) - 120.0 * phase for phase in range(3)]
        s = [trapezoid(angle) for angle in electrical]
        r = [demand(angle) for angle in electrical]
        for phase in range(3):
            off = reference * r[phase] - i[phase]
            if off > e.hysteresis:
                legs[phase] = 1
            elif off < -e.hysteresis:
                legs[phase] = -1
        # 4. Windings: v_n makes the slopes of the currents sum to zero.
        v = [leg * e.supply / 2 for leg in legs]
        K = [
            actuator.motor.torque_constant
            / 2
            * turns[phase]
            * (1 + Z * math.cos(rotor + phi + 2 * math.pi * phase / 3))
            for phase in range(3)
        ]
        driving_voltages = [v[p] - R[p] * i[p] - K[p] * s[p] * w for p in range(3)]
        v_n = sum(driving_voltages[p] / L[p] for p in range(3)) / sum(1 / L[p] for p in range(3))
        i = [i[p] + dt * (driving_voltages[p] - v_n) / L[p] for p in range(3)]
        # 5. Torque.
        torque = sum(K[p] * s[p] * i[p] for p in range(3))
        torque = min(max(torque, -actuator.motor.torque_limit), actuator.motor.torque_limit)
        felt = torque = torque + (felt - torque) * torque_decay
        # 6. Mechanics.
        # The load stiffness acts on the position of the user at the start of the step.
        active = torque - load - m.offset - m.hinge * (m.gear_ratio * output) - m.viscous * w
        if w == 0.0:
            sticks = abs(active) <= static
            w = 0.0 if sticks else dt * (active - math.copysign(dynamic, active)) / m.inertia
        else:
            following = w + dt * (active - math.copysign(dynamic, w)) / m.inertia
            w = 0.0 if (following > 0) != (w > 0) else following
        theta += w * dt
        if theta - gap / 2 > high or theta + gap / 2 < low:
            theta = high + gap / 2 if theta > 0 else low - gap / 2
            w = 0.0
        # 7. Backlash.
        output = min(max(output, theta - gap / 2), theta + gap / 2)
        trace.append(
            (
                sum(s[p] * i[p] for p in range(3)) / 2,
                sum(r[p] * i[p] for p in range(3)) / 2,
                sum(abs(current) for current in i) / 2 * math.copysign(1, torque),
                sum(r[p] * v[p] for p in range(3)),
                *i,
                *v,
                w,
                theta,
                m.gear_ratio * output,
                torque,
                reference,
            )
        )
    names = (
        "current_A",
        "current_active_A",
        "current_magnitude_A",
        "voltage_V",
        "current_a_A",
        "current_b_A",
        "current_c_A",
        "voltage_a_V",
        "voltage_b_V",
        "voltage_c_V",
        "speed_rad_s",
        "angle_rad",
        "position_rad",
        "torque_Nm",
        "reference_current_A",
    )
    return dict(zip(names, np.array(trace).T, strict=True))
