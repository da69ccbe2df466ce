"""An inverter leg whose switches are both off: its diodes alone conduct."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.select import clip, select


def diode_voltage(current: Any, open_voltage: Any, half_supply: Any) -> Any:
    """Return the voltage of a leg whose switches are off.

        v = -V_dc/2   (i > 0: the lower diode carries a current out of the leg)
        v = +V_dc/2   (i < 0: the upper diode)
        v = clip(v_o, -V_dc/2, V_dc/2)   (i = 0: both block, unless the winding drives a current through one)

    Parameters
    ----------
    current : i, from the leg into its winding [A]
    open_voltage : v_o, of the terminal while no current flows: centre of the star plus back-EMF [V]
    half_supply : V_dc / 2 [V]

    Returns
    -------
    v [V].

    Notes
    -----
    Ideal diodes. At v = v_o the winding's current stays 0.
    """
    floating = clip(open_voltage, -half_supply, half_supply)
    return select(current > 0.0, -half_supply, select(current < 0.0, half_supply, floating))


def diode_current(before: Any, after: Any, open_voltage: Any, half_supply: Any) -> Any:
    """Return the current of a leg whose switches are off after a step: a diode ends it at 0.

        i⁺ = 0 where i i' < 0, or where i = 0 and |v_o| ≤ V_dc/2, else i'

    Parameters
    ----------
    before, after : i, and i' as the windings alone would have it [A]
    open_voltage : v_o, of the terminal while no current flows [V]
    half_supply : V_dc / 2 [V]

    Returns
    -------
    i⁺ [A].
    """
    ended = select(before * after < 0.0, 0.0, after)
    blocking = select(np.abs(open_voltage) <= half_supply, 0.0, ended)
    return select(before == 0.0, blocking, ended)


def outgoing_after(current: Any, half_supply: Any, back_emf: Any, resistance: Any, fall: Any) -> Any:
    """Return the current of a phase that has stopped to conduct, after a step, for an averaged model.

        |i⁺| = max(|i| - f (u + 3/2 R |i|), 0),   u = V_dc/2 + sgn(i) e
        f = Δt (1 - L_p / L) / L,   1 / L_p = Σ 1 / L_i

    The diode lays half the supply against it, while the mean voltages of the other two legs are opposite. As
    one winding these two, a that continues and c that comes in, have a current that loses, in addition to
    what their own voltage makes of it, L_c / (L_a + L_c) of

        Δ = (|i| - |i⁺|) u / (u + 3/2 R |i|)

    Parameters
    ----------
    current : i, with the sign of the current through the two conducting phases [A]
    half_supply : V_dc / 2 [V]
    back_emf : e, of the phase, positive where it opposes a positive current of the pair [V]
    resistance : R, of the phase [ohm]
    fall : f [s/H]

    Returns
    -------
    i⁺, and Δ with the sign of i [A].

    Notes
    -----
    Exact for three equal windings and small steps. Without resistance the flux linkage of the new pair is
    conserved, L_a I = (L_a + L_c) I⁺: a healthy machine loses half its current where the controller of the
    current is slow compared with the commutation.

    References
    ----------
    [1] R. Carlson, M. Lajoie-Mazenc, J. C. dos S. Fagundes: Analysis of torque ripple due to phase
        commutation in brushless DC machines. IEEE Trans. Ind. Appl. 28(3), 1992.
    """
    size = np.abs(current)
    driving = np.maximum(half_supply + np.copysign(1.0, current) * back_emf, 0.0)
    against = driving + 1.5 * resistance * size
    remaining = np.maximum(size - fall * against, 0.0)
    # Where nothing is against the current, none is lost: the smallest number keeps the share finite.
    taken = (size - remaining) * driving / np.maximum(against, 1e-30)
    return np.copysign(remaining, current), np.copysign(taken, current)
