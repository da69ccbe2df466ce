"""Three windings in a star whose centre is not connected."""

from typing import Any

from emaphm.simulation.laws.inline import law


@law
def star_slopes(
    drive_a: Any,
    drive_b: Any,
    drive_c: Any,
    inverse_a: Any,
    inverse_b: Any,
    inverse_c: Any,
    parallel: Any,
) -> Any:
    """Return how fast the three phase currents change.

    Each winding takes what its leg's voltage leaves over the centre's, and the centre takes the voltage
    that keeps the sum of the currents at zero:

        di_i/dt = (d_i - v_n) / L_i,   d_i = v_i - R_i i_i - e_i
        v_n = L_p Σ d_i / L_i,         1 / L_p = Σ 1 / L_i

    Parameters
    ----------
    drive_a, drive_b, drive_c : d_i, leg voltage less resistive drop and back-EMF [V]
    inverse_a, inverse_b, inverse_c : 1 / L_i [1/H]
    parallel : L_p, inductance of the three windings in parallel [H]

    Returns
    -------
    di_a/dt, di_b/dt, di_c/dt [A/s]; with Δt / L_i and L_p / Δt for 1 / L_i and L_p, the changes over an
    explicit Euler step Δt [A].

    Notes
    -----
    No mutual inductance, no saturation. Explicit Euler is stable for Δt < 2 L_i / R_i.

    References
    ----------
    [1] Thesis, section 3.1.3, Fig. 3.9; R_i, L_i and e_i under short circuits: section 4.4.
    """
    centre = (drive_a * inverse_a + drive_b * inverse_b + drive_c * inverse_c) * parallel
    return (drive_a - centre) * inverse_a, (drive_b - centre) * inverse_b, (drive_c - centre) * inverse_c
