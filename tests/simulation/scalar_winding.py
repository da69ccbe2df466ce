"""Independent monitor and averaged models: scalar, written only from docs/physics.md, sections 4 and 5."""

import math
from collections.abc import Callable
from typing import Literal

import numpy as np
from scipy.signal import sawtooth

from emaphm.actuator import Actuator, Faults
from emaphm.arrays import Array

Shorts = Literal["printed", "modulated", "phases"]

CONDUCTING = ((1, 2), (0, 1), (2, 0))
"""The phases that conduct in the sectors about 0, 60 and 120 deg: f(theta) of thesis 4.4."""


def conducting(degrees: float) -> tuple[int, int]:
    """Return the two phases that conduct at an electrical angle [deg]; sectors of 60 deg start at -30."""
    return CONDUCTING[int((degrees + 30.0) // 60.0) % 3]


def simulate(  # noqa: PLR0915 - one step, in the order of docs/physics.md
    actuator: Actuator,
    faults: Faults,
    command: Callable[[float], float],
    steps: int,
    dt: float,
    *,
    averaged: bool,
    shorts: Shorts = "phases",
    printed_eccentricity: bool = False,
    load: float = 0.0,
    rotor_offset: float = 0.0,
) -> dict[str, Array]:
    """Return current [A], voltage [V], user position, speed, angle, torque and reference after each step."""
    e, c, m, k_e = (
        actuator.electrical,
        actuator.controller,
        actuator.mechanics,
        actuator.motor.torque_constant,
    )
    assert e is not None
    assert c.speed_limit is not None
    assert actuator.motor.torque_limit is not None
    k1, k2, ka, kb, kc, k6, k7, k8 = (float(k) for k in faults.vector)
    N = [max(1 - k, 0.01) for k in (ka, kb, kc)]
    Z, phi = 0.42 * k6, (2 * k7 - 1) * math.pi
    static, dynamic = m.static_friction * (1 + 2 * k1), m.dynamic_friction * (1 + 2 * k1)
    gap = m.backlash * (1 + 9 * k2)

    i = theta = w = sensed_speed = felt = output = integral = 0.0
    previous: float | None = None
    # Speed feedback and torque may have a lag.
    speed_decay, torque_decay = (
        math.exp(-dt / lag) if lag else 0.0 for lag in (c.speed_lag, actuator.motor.torque_lag)
    )
    trace = []
    for n in range(steps):
        wanted = (0.5 + k8) * c.position_gain * (command(n * dt) - m.gear_ratio * output)
        sensed_speed = w + (sensed_speed - w) * speed_decay
        error = min(max(wanted, -c.speed_limit), c.speed_limit) - sensed_speed
        slope = 0.0 if previous is None else (error - previous) / dt
        demanded_torque = c.speed_gain * error + c.integral_gain * integral + c.derivative_gain * slope
        reference = min(max(demanded_torque / actuator.drive_constant, -c.current_limit), c.current_limit)
        integral += error * dt
        previous = error

        rotor = theta + rotor_offset
        pair = conducting(math.degrees(e.pole_pairs * rotor))
        if shorts == "phases":
            R = e.resistance / 2 * sum(N[p] for p in pair)
            L = e.inductance / 2 * sum(N[p] ** 2 for p in pair)
            weights = [N[p] / 2 for p in pair]
        else:
            mean = sum(N) / 3 if shorts == "printed" else sum(N[p] for p in pair) / 2
            R, L, weights = e.resistance * mean, e.inductance * mean**2, [mean / 2, mean / 2]
        if printed_eccentricity:
            u = e.pole_pairs * rotor
            wave = float(sawtooth(math.cos(6 * u - math.pi))) * math.sin(u - math.pi)
            factors = [1 - Z * (math.cos(u - phi) + wave)] * 2
        else:
            factors = [1 + Z * math.cos(rotor + phi + 2 * math.pi * p / 3) for p in pair]
        k = k_e * sum(weight * g for weight, g in zip(weights, factors, strict=True))

        decay = math.exp(-dt * R / L)

        def after(
            voltage: float, *, i: float = i, emf: float = k * w, R: float = R, decay: float = decay
        ) -> float:
            return (voltage - emf) / R * (1 - decay) + i * decay

        if averaged:
            new = min(max(reference, after(-e.supply)), after(e.supply))
        else:
            new = after(e.supply * float(np.sign(reference - i)))
        voltage = k * w + R * (new - i * decay) / (1 - decay)
        i = new
        torque = min(max(k * i, -actuator.motor.torque_limit), actuator.motor.torque_limit)
        felt = torque = torque + (felt - torque) * torque_decay
        # The load stiffness acts on the position of the user at the start of the step.
        active = torque - load - m.offset - m.hinge * (m.gear_ratio * output) - m.viscous * w
        if w == 0.0:
            sticks = abs(active) <= static
            w = 0.0 if sticks else dt * (active - math.copysign(dynamic, active)) / m.inertia
        else:
            following = w + dt * (active - math.copysign(dynamic, w)) / m.inertia
            w = 0.0 if (following > 0) != (w > 0) else following
        theta += w * dt
        output = min(max(output, theta - gap / 2), theta + gap / 2)
        trace.append((i, voltage, m.gear_ratio * output, w, theta, torque, reference))
    names = (
        "current_A",
        "voltage_V",
        "position_rad",
        "speed_rad_s",
        "angle_rad",
        "torque_Nm",
        "reference_current_A",
    )
    return dict(zip(names, np.array(trace).T, strict=True))
