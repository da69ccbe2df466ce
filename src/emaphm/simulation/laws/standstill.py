"""Dry friction through standstill: sticking, or a steep slope, by an implicit step that never oscillates."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.inline import law


@law
def speed_against(free: Any, braking: Any) -> Any:
    """Return the speed after a step against dry friction that sticks.

        ω⁺ = sgn(ω_0) max(|ω_0| - f Δt / J, 0)

    Parameters
    ----------
    free : ω_0, speed that the step would lead to without dry friction [rad/s]
    braking : f Δt / J ≥ 0, what dry friction of level f can take in the step [rad/s]

    Returns
    -------
    ω⁺, speed after the step [rad/s].

    Notes
    -----
    Backward Euler of ω̇ = τ/J - (f/J) sgn ω: the shaft sticks for as long as the torque is below the level.
    """
    return np.copysign(np.maximum(np.abs(free) - braking, 0.0), free)


@law
def saturation(ratio: Any) -> Any:
    """Return the smooth sign of x ≥ 0 and its derivative: x (27 + x²) / (27 + 9 x²), 1 from x = 3 on.

    Within 2.4 % of tanh x, and its derivative continuous. Returned as numerator and denominator of the value,
    and numerator of the derivative over the denominator squared.
    """
    x = np.minimum(ratio, 3.0)
    square = x * x
    numerator = x * (27.0 + square)
    denominator = 27.0 + 9.0 * square
    slope = (27.0 + 3.0 * square) * denominator - 18.0 * x * numerator
    return numerator, denominator, slope


@law
def newton_step(speed: Any, size: Any, braking: Any, inverse_transition: Any) -> Any:
    """Return the next iterate of |ω⁺| in `speed_through_standstill`, whose symbols these are."""
    numerator, denominator, slope = saturation(speed * inverse_transition)
    square = denominator * denominator
    missing = (speed - size) * square + braking * numerator * denominator
    steepness = square + braking * inverse_transition * slope
    return np.maximum(speed - missing / steepness, 0.0)


@law
def speed_through_standstill(free: Any, braking: Any, inverse_transition: Any) -> Any:
    """Return the speed after a step against dry friction that passes smoothly through standstill.

    Friction is f σ(ω / ω_t), with σ the smooth sign of `saturation`, close to tanh. Backward Euler:

        |ω⁺| + (f Δt / J) σ(|ω⁺| / ω_t) = |ω_0|,   sgn ω⁺ = sgn ω_0

    is solved by two Newton steps from the speed that a straight slope would give, which is below the
    solution, so that they approach it from below.

    Parameters
    ----------
    free : ω_0, speed that the step would lead to without dry friction [rad/s]
    braking : f Δt / J ≥ 0, what the full dry friction of level f can take in the step [rad/s]
    inverse_transition : 1 / ω_t, ω_t > 0 the speed at which friction has reached 0.78 of its level [s/rad]

    Returns
    -------
    ω⁺, speed after the step [rad/s].

    Notes
    -----
    Stable for any step. The shaft does not stick: under a steady torque below f it creeps with less than ω_t,
    as it would in the presliding of a bristle. Where f Δt / J exceeds 5 ω_t, ω⁺ is up to ω_t too small.
    """
    size = np.abs(free)
    speed = np.maximum(size - braking, size / (1.0 + braking * inverse_transition))
    speed = newton_step(speed, size, braking, inverse_transition)
    speed = newton_step(speed, size, braking, inverse_transition)
    return np.copysign(speed, free)
