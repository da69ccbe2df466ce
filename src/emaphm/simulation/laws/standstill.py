"""Dry friction through standstill, sticking or with a smooth sign, by implicit steps without oscillation."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.select import select


def speed_against(free: Any, braking: Any) -> Any:
    """Return the speed after a step against dry friction with sticking.

        ω⁺ = sgn(ω_0) max(|ω_0| - f Δt / J, 0)

    Parameters
    ----------
    free : ω_0, speed after the step without dry friction [rad/s]
    braking : f Δt / J ≥ 0, largest change of the speed in the step by dry friction of level f [rad/s]

    Returns
    -------
    ω⁺, speed after the step [rad/s].

    Notes
    -----
    Backward Euler of ω̇ = τ/J - (f/J) sgn ω. A shaft at rest sticks while |τ| ≤ f.
    """
    return np.copysign(np.maximum(np.abs(free) - braking, 0.0), free)


SATURATED = 3.95
"""x_s, ratio of the speed to the transition speed above which friction has its full level [-]."""

CURVATURE = 0.0133
"""λ of `saturation` [-]; with `SATURATED` it gives the best approximation of tanh."""


def saturation(ratio: Any, braking: Any) -> Any:
    """Return the smooth sign σ at the speed after an implicit step against it, in closed form.

    σ(x), x ≥ 0, is the arc of a conic with slope 1 at the origin that reaches 1 with slope 0 at x_s:

        (x - σ)(1 - σ) = λ (x - x_s σ)²   (x ≤ x_s),   σ = 1   (x ≥ x_s)

    Backward Euler requires x + β σ(x) = y. The solution is the root of a quadratic equation, so that no
    iteration is needed; σ = 1 if y ≥ S:

        A σ² - B σ + C = 0,   A = 1 + β - λ S²,  B = 1 + β + y - 2 λ y S,  C = y - λ y²,  S = β + x_s
        B² - 4 A C = (1 + β - y)² + 4 λ (x_s - 1) y (S - y)

    Parameters
    ----------
    ratio : y ≥ 0, speed after the step without dry friction, divided by the transition speed [-]
    braking : β ≥ 0, change of that ratio in the step by the full dry friction; 0 for σ(y) itself [-]

    Returns
    -------
    σ, in [0, 1], within 0.005 of tanh x [-].

    Notes
    -----
    σ = (B - √(B² - 4 A C)) / (2 A) = 2 C / (B + √(B² - 4 A C)); of these two forms, the code uses the form
    without cancellation. The derivative of σ is continuous.
    """
    reach = braking + SATURATED
    square = 1.0 + braking - CURVATURE * reach * reach
    linear = 1.0 + braking + ratio - (2.0 * CURVATURE) * ratio * reach
    constant = ratio - CURVATURE * ratio * ratio
    difference = 1.0 + braking - ratio
    root = np.sqrt(
        np.maximum(
            difference * difference + (4.0 * CURVATURE * (SATURATED - 1.0)) * ratio * (reach - ratio), 0.0
        )
    )
    positive = linear > 0.0
    numerator = select(positive, 2.0 * constant, linear - root)
    denominator = select(positive, linear + root, 2.0 * square)
    return select(ratio < reach, numerator / denominator, 1.0)


def speed_through_standstill(free: Any, braking: Any, inverse_transition: Any) -> Any:
    """Return the speed after a step against dry friction that changes its sign smoothly at standstill.

    Friction is f σ(ω / ω_t), with the smooth sign σ of `saturation`, close to tanh. Backward Euler:

        |ω⁺| + (f Δt / J) σ(|ω⁺| / ω_t) = |ω_0|,   sgn ω⁺ = sgn ω_0

    Parameters
    ----------
    free : ω_0, speed after the step without dry friction [rad/s]
    braking : f Δt / J ≥ 0, largest change of the speed in the step by dry friction of level f [rad/s]
    inverse_transition : 1 / ω_t, with ω_t > 0 the speed at which friction is 0.76 of its level [s/rad]

    Returns
    -------
    ω⁺, speed after the step [rad/s].

    Notes
    -----
    The implicit equation is solved exactly; stable for any step. The shaft does not stick: under a constant
    torque below f it creeps at less than x_s ω_t.
    """
    size = np.abs(free)
    share = saturation(size * inverse_transition, braking * inverse_transition)
    return np.copysign(np.maximum(size - braking * share, 0.0), free)
