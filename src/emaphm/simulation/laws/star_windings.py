"""Three windings in a star without a connected centre."""

from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.simulation.laws.phases import Phases


def star_slopes(drive: Phases, inverse: Phases, parallel: Any) -> Any:
    """Return the time derivatives of the three phase currents.

    The voltage v_n of the star's centre keeps the sum of the currents at zero:

        di_i/dt = (d_i - v_n) / L_i,   d_i = v_i - R_i i_i - e_i
        v_n = L_p Σ d_i / L_i,         1 / L_p = Σ 1 / L_i

    Parameters
    ----------
    drive : d_i, leg voltage less resistive drop and back-EMF [V]
    inverse : 1 / L_i [1/H]
    parallel : L_p, inductance of the three windings in parallel [H]

    Returns
    -------
    di_i/dt [A/s]. With Δt / L_i and L_p / Δt in place of 1 / L_i and L_p: the changes over an explicit Euler
    step Δt [A].

    Notes
    -----
    No mutual inductance, no saturation. Explicit Euler is stable for Δt < 2 L_i / R_i.

    References
    ----------
    [1] Thesis, section 3.1.3, Fig. 3.9; R_i, L_i and e_i under short circuits: section 4.4.
    """
    centre = (drive * inverse).sum() * parallel
    return (drive - centre) * inverse


def star_response(resistance: Array, inductance: Array, step: float) -> dict[str, Array]:
    """Return the coefficients of `star_currents_after` for the windings of a star.

    With the currents x = (i_a, i_b) and i_c = -i_a - i_b, the equations of the star are M dx/dt = u - Q x,

        Q = | R_a + R_c   R_c       |    M likewise, with L_i in place of R_i
            | R_c         R_b + R_c |

    and Φ = exp(A) with A = -M⁻¹Q Δt, whose two eigenvalues α ± β are real:

        Φ = e^α (cosh β I + (sinh β / β) (A - α I)),   α = tr A / 2, β² = α² - det A

    Parameters
    ----------
    resistance, inductance : R_i [ohm], L_i [H], shape (3, n)
    step : Δt, step [s]

    Returns
    -------
    Φ, "remaining_aa" to "remaining_bb" [-], and Q⁻¹, "conductance_aa", "_ab", "_bb" [S], shape (n,) each.
    """
    r_a, r_b, r_c = resistance
    l_a, l_b, l_c = inductance
    of_r = r_a * r_b + r_b * r_c + r_c * r_a
    of_l = l_a * l_b + l_b * l_c + l_c * l_a
    aa = -step * ((l_b + l_c) * (r_a + r_c) - l_c * r_c) / of_l
    ab = -step * ((l_b + l_c) * r_c - l_c * (r_b + r_c)) / of_l
    ba = -step * ((l_a + l_c) * r_c - l_c * (r_a + r_c)) / of_l
    bb = -step * ((l_a + l_c) * (r_b + r_c) - l_c * r_c) / of_l
    mean, half = (aa + bb) / 2, (aa - bb) / 2
    beta = np.sqrt(np.maximum(half**2 + ab * ba, 0.0))
    # e^α cosh β and e^α sinh β / β from the eigenvalues, which are both negative: no overflow.
    slow, fast = np.exp(mean + beta), np.exp(mean - beta)
    even = (slow + fast) / 2
    odd = np.where(beta > 1e-9, (slow - fast) / (2 * np.maximum(beta, 1e-9)), np.exp(mean))
    return {
        "remaining_aa": even + odd * half,
        "remaining_ab": odd * ab,
        "remaining_ba": odd * ba,
        "remaining_bb": even - odd * half,
        "conductance_aa": (r_b + r_c) / of_r,
        "conductance_ab": -r_c / of_r,
        "conductance_bb": (r_a + r_c) / of_r,
    }


def star_currents_after(
    current: Phases,
    drive: Phases,
    remaining_aa: Any,
    remaining_ab: Any,
    remaining_ba: Any,
    remaining_bb: Any,
    conductance_aa: Any,
    conductance_ab: Any,
    conductance_bb: Any,
) -> Phases:
    """Return the three phase currents after a step under constant voltages.

    This is the exact solution of the star's equations, with the voltage of the centre eliminated:

        x_∞ = Q⁻¹ (d_a - d_c, d_b - d_c),   x⁺ = x_∞ + Φ (x - x_∞),   x = (i_a, i_b)

    Parameters
    ----------
    current : i_i, currents before the step [A]
    drive : d_i, leg voltage less back-EMF, constant over the step [V]
    remaining_aa, remaining_ab, remaining_ba, remaining_bb : Φ, from `star_response` [-]
    conductance_aa, conductance_ab, conductance_bb : Q⁻¹, symmetric, from `star_response` [S]

    Returns
    -------
    i_i⁺, currents after the step [A]; i_c⁺ = -i_a⁺ - i_b⁺.

    Notes
    -----
    Stable for any step and any windings. No mutual inductance, no saturation.
    """
    over_a, over_b = drive.a - drive.c, drive.b - drive.c
    final_a = conductance_aa * over_a + conductance_ab * over_b
    final_b = conductance_ab * over_a + conductance_bb * over_b
    deviation_a, deviation_b = current.a - final_a, current.b - final_b
    after_a = final_a + remaining_aa * deviation_a + remaining_ab * deviation_b
    after_b = final_b + remaining_ba * deviation_a + remaining_bb * deviation_b
    return Phases(after_a, after_b, -after_a - after_b)
