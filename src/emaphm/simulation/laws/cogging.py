"""Torque ripple: harmonics of an angle whose cosine and sine are known."""

from collections.abc import Callable
from functools import cache
from typing import Any


@cache
def harmonic(order: int) -> Callable[..., Any]:
    """Return the function that maps (cos θ, sin θ) to (cos nθ, sin nθ), n = `order` ≥ 1.

    It uses the addition theorems, cos(a + b) = cos a cos b - sin a sin b, sin(a + b) = sin a cos b + cos a
    sin b: one doubling of the angle for each binary digit of n, and one addition of θ for each digit 1.
    """
    if order == 1:
        return _first_harmonic
    if order % 2:
        lower = harmonic(order - 1)

        def next_harmonic(cos: Any, sin: Any) -> Any:
            c, s = lower(cos, sin)
            return c * cos - s * sin, s * cos + c * sin

        return next_harmonic
    half = harmonic(order // 2)

    def doubled(cos: Any, sin: Any) -> Any:
        c, s = half(cos, sin)
        return c * c - s * s, 2.0 * s * c

    return doubled


def _first_harmonic(cos: Any, sin: Any) -> Any:
    return cos, sin


def ripple_torque(cos: Any, sin: Any, along: Any, across: Any) -> Any:
    """Return one harmonic of the torque ripple.

        τ_n = A_n cos nθ + B_n sin nθ

    Parameters
    ----------
    cos, sin : cosine and sine of n θ, with θ the mechanical angle of the rotor or of the screw [-]
    along, across : A_n, B_n, amplitudes of the cosine and of the sine [N·m]

    Returns
    -------
    τ_n, torque to be added to the motor's torque [N·m].

    Notes
    -----
    Cogging of a motor with N_s slots and 2 P poles has the least common multiple of N_s and 2 P as its
    lowest order, and multiples of it. A bent screw or an uneven bearing has the lowest orders of the screw's
    angle. The amplitude does not depend on current or speed.

    References
    ----------
    [1] D. C. Hanselman: Brushless permanent magnet motor design, 2nd ed., 2003, chapter 5.
    """
    return along * cos + across * sin
