"""Stribeck friction: the fall of dry friction from its static to its dynamic level as the speed grows."""

from typing import Any

from emaphm.simulation.laws.exponential import decaying_exponential


def stribeck_factor(speed: Any, inverse_speed: Any) -> Any:
    """Return the share of the static friction's excess that is left at a speed.

        s(ω) = exp(-(ω / ω_s)²)

    so that dry friction is f_d + s (f_s - f_d): f_s at rest, f_d from about 2 ω_s on.

    Parameters
    ----------
    speed : ω, motor shaft [rad/s]
    inverse_speed : 1 / ω_s, ω_s > 0 the Stribeck speed [s/rad]

    Returns
    -------
    s, in (0, 1] [-], within 4e-6 (`decaying_exponential`).

    Notes
    -----
    The Gaussian form. Mixed lubrication has no first-principles curve: exponents from 0.5 to 2 are fitted in
    the literature, and machines with grease often fall more slowly than this one.

    References
    ----------
    [1] B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit: A survey of models, analysis tools and
        compensation methods for the control of machines with friction. Automatica 30(7), 1994.
    """
    ratio = speed * inverse_speed
    return decaying_exponential(ratio * ratio)
