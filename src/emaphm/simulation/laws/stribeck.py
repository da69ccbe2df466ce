"""Stribeck friction: dry friction falls from its static to its dynamic level as the speed rises."""

from typing import Any

from emaphm.simulation.laws.exponential import decaying_exponential


def stribeck_factor(speed: Any, inverse_speed: Any) -> Any:
    """Return the Stribeck factor at a speed.

        s(ω) = exp(-(ω / ω_s)²)

    Dry friction is f_d + s (f_s - f_d): f_s at rest, f_d above about 2 ω_s.

    Parameters
    ----------
    speed : ω, speed of the motor shaft [rad/s]
    inverse_speed : 1 / ω_s, with ω_s > 0 the Stribeck speed [s/rad]

    Returns
    -------
    s, in (0, 1] [-], with an error of at most 4e-6 (`decaying_exponential`).

    Notes
    -----
    Gaussian form. No curve for mixed lubrication follows from first principles: the literature fits exponents
    from 0.5 to 2, and the friction of greased machines often falls more slowly than in this form.

    References
    ----------
    [1] B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit: A survey of models, analysis tools and
        compensation methods for the control of machines with friction. Automatica 30(7), 1994.
    """
    ratio = speed * inverse_speed
    return decaying_exponential(ratio * ratio)
