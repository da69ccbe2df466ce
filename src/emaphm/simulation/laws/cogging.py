"""Torque ripple: harmonics of an angle whose cosine and sine are known."""

from collections.abc import Callable
from functools import cache
from typing import Any


@cache
def harmonic(order: int) -> Callable[..., Any]:
    """Return the law that turns (cos θ, sin θ) into (cos nθ, sin nθ), n = `order` ≥ 1.

    By the addition theorems, cos(a + b) = cos a cos b - sin a sin b, sin(a + b) = sin a cos b + cos a sin b:
    a doubling for each binary digit of n, and one addition for each that is 1.
    """
    if order == 1:
        return _itself
    if order % 2:
        before = harmonic(order - 1)

        def one_more(cos: Any, sin: Any) -> Any:
            c, s = before(cos, sin)
            return c * cos - s * sin, s * cos + c * sin

        return one_more
    half = harmonic(order // 2)

    def doubled(cos: Any, sin: Any) -> Any:
        c, s = half(cos, sin)
        return c * c - s * s, 2.0 * s * c

    return doubled


def _itself(cos: Any, sin: Any) -> Any:
    return cos, sin


def ripple_torque(cos: Any, sin: Any, along: Any, across: Any) -> Any:
    """Return one harmonic of the torque ripple.

        τ_n = A_n cos nθ + B_n sin nθ

    Parameters
    ----------
    cos, sin : of n θ, θ the mechanical angle of the rotor or of the screw [-]
    along, across : A_n, B_n [N·m]

    Returns
    -------
    τ_n, added to the motor's torque [N·m].

    Notes
    -----
    Cogging of a motor with N_s slots and 2 P poles has the order of the least common multiple of both, and
    its multiples; a bent screw or an uneven bearing has the first orders of the screw's turn. The amplitude
    does not depend on current or speed.

    References
    ----------
    [1] D. C. Hanselman: Brushless permanent magnet motor design, 2nd ed., 2003, chapter 5.
    """
    return along * cos + across * sin
