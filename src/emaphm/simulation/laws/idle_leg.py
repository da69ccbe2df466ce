"""Inverter leg with both switches off: only its diodes conduct."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.select import clip, select


def diode_voltage(current: Any, open_voltage: Any, half_supply: Any) -> Any:
    """Return the voltage of a leg whose switches are off.

        v = -V_dc/2   (i > 0: the lower diode conducts)
        v = +V_dc/2   (i < 0: the upper diode conducts)
        v = clip(v_o, -V_dc/2, V_dc/2)   (i = 0: both diodes block if |v_o| ≤ V_dc/2)

    Parameters
    ----------
    current : i, from the leg into its winding [A]
    open_voltage : v_o, voltage of the terminal without current: star centre plus back-EMF [V]
    half_supply : V_dc / 2 [V]

    Returns
    -------
    v, voltage of the leg [V].

    Notes
    -----
    Ideal diodes. At v = v_o the current of the winding remains 0.
    """
    floating = clip(open_voltage, -half_supply, half_supply)
    return select(current > 0.0, -half_supply, select(current < 0.0, half_supply, floating))


def diode_current(before: Any, after: Any, open_voltage: Any, half_supply: Any) -> Any:
    """Return the current after a step of a leg whose switches are off: a diode stops the current at 0.

        i⁺ = 0    (i i' < 0, or i = 0 and |v_o| ≤ V_dc/2)
        i⁺ = i'   (otherwise)

    Parameters
    ----------
    before : i, current before the step [A]
    after : i', current after the step without the diodes' blocking [A]
    open_voltage : v_o, voltage of the terminal without current [V]
    half_supply : V_dc / 2 [V]

    Returns
    -------
    i⁺, current after the step [A].
    """
    ended = select(before * after < 0.0, 0.0, after)
    blocking = select(np.abs(open_voltage) <= half_supply, 0.0, ended)
    return select(before == 0.0, blocking, ended)


def outgoing_after(current: Any, half_supply: Any, back_emf: Any, resistance: Any, fall: Any) -> Any:
    """Return the decaying current of the outgoing phase after a step, for an averaged model.

    The outgoing phase is the phase whose switches the commutation has turned off. Its current decays as

        |i⁺| = max(|i| - f (u + 3/2 R |i|), 0),   u = V_dc/2 + sgn(i) e
        f = Δt (1 - L_p / L) / L,   1 / L_p = Σ 1 / L_i

    because the diode applies half the supply voltage against the current, and the mean voltages of the other
    two legs are opposite to each other. These two legs, a that continues to conduct and c that starts to
    conduct, are one equivalent winding. In addition to the effect of its own voltage, its current falls by
    L_c / (L_a + L_c) times

        Δ = (|i| - |i⁺|) u / (u + 3/2 R |i|)

    Parameters
    ----------
    current : i, of the outgoing phase, with the sign of the current through the two conducting phases [A]
    half_supply : V_dc / 2 [V]
    back_emf : e, of the phase; positive if it opposes a positive current of the pair [V]
    resistance : R, of the phase [ohm]
    fall : f, from the step Δt, the inductance L of the phase and L_p of the three phases in parallel [s/H]

    Returns
    -------
    i⁺, and Δ with the sign of i [A].

    Notes
    -----
    Exact for three equal windings and small steps. Without resistance the flux linkage of the new pair is
    conserved, L_a I = (L_a + L_c) I⁺: the current of a healthy machine falls to half if the current
    controller is slow compared with the commutation.

    References
    ----------
    [1] R. Carlson, M. Lajoie-Mazenc, J. C. dos S. Fagundes: Analysis of torque ripple due to phase
        commutation in brushless DC machines. IEEE Trans. Ind. Appl. 28(3), 1992.
    """
    size = np.abs(current)
    driving = np.maximum(half_supply + np.copysign(1.0, current) * back_emf, 0.0)
    opposing = driving + 1.5 * resistance * size
    remaining = np.maximum(size - fall * opposing, 0.0)
    # Without opposing voltage the current does not change; the small number avoids 0 / 0.
    loss = (size - remaining) * driving / np.maximum(opposing, 1e-30)
    return np.copysign(remaining, current), np.copysign(loss, current)
