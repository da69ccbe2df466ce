"""Dry friction through standstill: sticking, or a steep slope, by an implicit step that never oscillates."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.select import select


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


SATURATED = 3.95
"""x_s, ratio of the speed to the transition speed from which friction has its full level [-]."""

CURVATURE = 0.0133
"""λ of `saturation`; with `SATURATED` it brings the curve closest to tanh [-]."""


def saturation(ratio: Any, braking: Any) -> Any:
    """Return the smooth sign σ at the speed that a step against it leads to, in closed form.

    σ(x), x ≥ 0, is the arc of a conic that leaves the origin with slope 1 and reaches 1 level at x_s:

        (x - σ)(1 - σ) = λ (x - x_s σ)²   (x ≤ x_s),   σ = 1   (x ≥ x_s)

    The line x + β σ = y meets it where a quadratic equation says, so that backward Euler needs no iteration:

        A σ² - B σ + C = 0,   A = 1 + β - λ S²,  B = 1 + β + y - 2 λ y S,  C = y - λ y²,  S = β + x_s
        B² - 4 A C = (1 + β - y)² + 4 λ (x_s - 1) y (S - y)

    Parameters
    ----------
    ratio : y ≥ 0, speed without dry friction over the transition speed [-]
    braking : β ≥ 0, what the full dry friction takes of that ratio in the step; 0 for σ(y) itself [-]

    Returns
    -------
    σ, in [0, 1], within 0.005 of tanh x.

    Notes
    -----
    Its derivative is continuous. Of the two forms of the root, the one that does not cancel is taken.
    """
    sum_of_both = braking + SATURATED
    square = 1.0 + braking - CURVATURE * sum_of_both * sum_of_both
    linear = 1.0 + braking + ratio - (2.0 * CURVATURE) * ratio * sum_of_both
    constant = ratio - CURVATURE * ratio * ratio
    apart = 1.0 + braking - ratio
    root = np.sqrt(
        np.maximum(apart * apart + (4.0 * CURVATURE * (SATURATED - 1.0)) * ratio * (sum_of_both - ratio), 0.0)
    )
    positive = linear > 0.0
    numerator = select(positive, 2.0 * constant, linear - root)
    denominator = select(positive, linear + root, 2.0 * square)
    return select(ratio < sum_of_both, numerator / denominator, 1.0)


def speed_through_standstill(free: Any, braking: Any, inverse_transition: Any) -> Any:
    """Return the speed after a step against dry friction that passes smoothly through standstill.

    Friction is f σ(ω / ω_t), with σ the smooth sign of `saturation`, close to tanh. Backward Euler:

        |ω⁺| + (f Δt / J) σ(|ω⁺| / ω_t) = |ω_0|,   sgn ω⁺ = sgn ω_0

    Parameters
    ----------
    free : ω_0, speed that the step would lead to without dry friction [rad/s]
    braking : f Δt / J ≥ 0, what the full dry friction of level f can take in the step [rad/s]
    inverse_transition : 1 / ω_t, ω_t > 0 the speed at which friction has reached 0.76 of its level [s/rad]

    Returns
    -------
    ω⁺, speed after the step [rad/s].

    Notes
    -----
    Exact for this σ, stable for any step. The shaft does not stick: under a steady torque below f it creeps
    with less than x_s ω_t, as it would in the presliding of a bristle.
    """
    size = np.abs(free)
    share = saturation(size * inverse_transition, braking * inverse_transition)
    return np.copysign(np.maximum(size - braking * share, 0.0), free)
