"""Static rotor eccentricity: how the flux linked by a phase varies with the rotor's angle (thesis 4.5)."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.inline import law, select

SQRT3_2 = float(np.sqrt(3) / 2)


@law
def gap_factors(cos: Any, sin: Any, z_cos: Any, z_sin: Any) -> Any:
    """Return g_i = 1 + Z cos(theta + phi + 2 pi i / 3) for the phases i = 0, 1, 2.

    `cos`, `sin` of the mechanical angle theta; (z_cos, z_sin) = Z (cos phi, sin phi).
    """
    along = cos * z_cos - sin * z_sin
    across = sin * z_cos + cos * z_sin
    return (
        1.0 + along,
        1.0 - 0.5 * along - SQRT3_2 * across,
        1.0 - 0.5 * along + SQRT3_2 * across,
    )


@law
def printed_factor(cos: Any, sin: Any, z_cos: Any, z_sin: Any) -> Any:
    """Return the thesis's printed factor for the monitor model, one period per electrical turn.

    1 - Z (cos(u - phi) + saw(cos(6 u - pi)) sin(u - pi)) with `cos`, `sin` of the electrical angle u and
    saw the sawtooth of period 2 pi that rises from -1 at 0.
    """
    twice = 2.0 * cos * cos - 1.0
    argument = -(4.0 * twice * twice * twice - 3.0 * twice)
    saw = argument / np.pi + select(argument >= 0.0, -1.0, 1.0)
    magnitude = np.sqrt(z_cos * z_cos + z_sin * z_sin)
    return 1.0 - (cos * z_cos + sin * z_sin) + magnitude * saw * sin
