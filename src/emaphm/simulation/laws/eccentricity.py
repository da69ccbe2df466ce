"""Static rotor eccentricity: variation of the flux linkage of each phase with the rotor's angle."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.select import select

SQRT3_2 = float(np.sqrt(3) / 2)


def gap_factors(cos: Any, sin: Any, z_cos: Any, z_sin: Any) -> Phases:
    """Return the factors of eccentricity on the torque constant and back-EMF constant of each phase.

    The air gap varies once per mechanical turn, g = g₀ (1 + ζ cos θ). The variation is shifted by a third of
    a turn from phase to phase:

        g_i = 1 + Z cos(θ + φ + 2π (i - 1) / 3),   i = 1, 2, 3 for the phases a, b, c

    Parameters
    ----------
    cos, sin : cosine and sine of θ, the rotor's mechanical angle [-]
    z_cos, z_sin : Z cos φ and Z sin φ, amplitude and direction of the eccentricity, 0 ≤ Z < 1 [-]

    Returns
    -------
    g_i, factors on k_i [-]. Their mean is 1.

    Notes
    -----
    First order in Z. Torque and back-EMF have the same factor, so power is conserved.

    References
    ----------
    [1] Thesis, section 4.5, Fig. 4.8 to 4.10.
    """
    cosine = cos * z_cos - sin * z_sin
    sine = sin * z_cos + cos * z_sin
    return Phases(
        1.0 + cosine,
        1.0 - 0.5 * cosine - SQRT3_2 * sine,
        1.0 - 0.5 * cosine + SQRT3_2 * sine,
    )


def printed_factor(cos: Any, sin: Any, z_cos: Any, z_sin: Any) -> Any:
    """Return the eccentricity factor that the thesis prints for its monitor model.

    It has one period per electrical turn:

        g = 1 - Z (cos(u - φ) + saw(cos(6u - π)) sin(u - π))

    with the sawtooth saw(x) = x/π - sgn x, which has the period 2π and rises from -1 at x = 0 (saw(0) = -1).
    The code needs no trigonometric function: cos(6u - π) = -(4t³ - 3t), t = cos 2u = 2 cos²u - 1.

    Parameters
    ----------
    cos, sin : cosine and sine of u = P θ, the electrical angle [-]
    z_cos, z_sin : Z cos φ and Z sin φ [-]

    Returns
    -------
    g, factor on the torque and back-EMF constant of the equivalent winding [-].

    Notes
    -----
    Kept for comparison with the thesis. It contradicts `gap_factors`, and the thesis's own derivation of one
    period per mechanical turn.

    References
    ----------
    [1] Thesis, section 4.5, Fig. 4.11 and 4.12.
    """
    twice = 2.0 * cos * cos - 1.0
    argument = -(4.0 * twice * twice * twice - 3.0 * twice)
    saw = argument / np.pi + select(argument >= 0.0, -1.0, 1.0)
    magnitude = np.sqrt(z_cos * z_cos + z_sin * z_sin)
    return 1.0 - (cos * z_cos + sin * z_sin) + magnitude * saw * sin
