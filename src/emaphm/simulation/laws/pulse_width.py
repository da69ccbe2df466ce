"""Pulse-width modulation of three legs by a triangular carrier, and the delay of a sampled controller."""

from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.select import clip, select

CONTROL_DELAY = 1.5
"""Delay from the sampling of the currents to the middle of the period that applies the voltage [periods]."""


def carrier_after(phase: Any, step_per_period: Any) -> Any:
    """Return the phase of the carrier after a step, in periods.

        p⁺ = p + Δt f       (p + Δt f ≤ 1 - Δt f / 2)
        p⁺ = p + Δt f - 1   (otherwise)

    Parameters
    ----------
    phase : p, in [-Δt f / 2, 1 - Δt f / 2); a period begins in the step in which p < Δt f / 2 [-]
    step_per_period : Δt f, ratio of the step to the carrier's period [-]

    Returns
    -------
    p⁺, in the same range [-].

    Notes
    -----
    A period begins at the nearest step. The mean frequency is exact: rounding errors do not accumulate.
    """
    following = phase + step_per_period
    return select(following > 1.0 - 0.5 * step_per_period, following - 1.0, following)


def triangle(phase: Any, step_per_period: Any) -> Any:
    """Return the carrier in the middle of a step: +1 at the start of the period, -1 at half of it.

        c = 4 |p + Δt f / 2 - 1/2| - 1

    Parameters
    ----------
    phase : p, phase of the carrier at the start of the step [-]
    step_per_period : Δt f [-]

    Returns
    -------
    c, in [-1, 1] [-].
    """
    return 4.0 * np.abs(phase + 0.5 * step_per_period - 0.5) - 1.0


def leg_mean(duty: Any, carrier: Any, step_per_period: Any) -> Any:
    """Return the mean state of a leg over a step: +1 while the duty is above the carrier, otherwise -1.

        s = clip((m - c) / (2 Δt f), -1, 1)

    Parameters
    ----------
    duty : m, in [-1, 1] [-]
    carrier : c, in the middle of the step [-]
    step_per_period : Δt f [-]

    Returns
    -------
    s, in [-1, 1]; the leg's mean voltage is s V_dc / 2 [-].

    Notes
    -----
    Exact if the carrier does not reverse within the step: a leg that switches within the step has the exact
    voltage-time area, so that the step does not quantise the duty. No dead time, no voltage drop.
    """
    return clip((duty - carrier) / (2.0 * step_per_period), -1.0, 1.0)


def half_ripple(supply: Any, duty: Any, per_volt: Any) -> Any:
    """Return the amplitude of the current ripple while two legs switch together to opposite rails.

        ΔI / 2 = V (1 - d²) / (4 L f)

    Parameters
    ----------
    supply : V, supply voltage [V]
    duty : d, mean voltage of the pair relative to the supply, in [-1, 1] [-]
    per_volt : 1 / (4 L f), with the inductance L of the pair and the frequency f of the carrier [A/V]

    Returns
    -------
    ΔI / 2, half of the peak-to-peak ripple [A].

    Notes
    -----
    Valid for periods that are short compared with L / R, where the ripple is nearly triangular.
    """
    return supply * (1.0 - duty * duty) * per_volt


def centred(duty: Phases) -> Any:
    """Return three duties shifted so that the largest and the smallest are symmetric about 0.

        m_i' = m_i - (max m + min m) / 2

    Parameters
    ----------
    duty : m_i = 2 v_i / V_dc, with v_i the demanded phase voltages [-]

    Returns
    -------
    m_i', within [-1, 1] for balanced voltages of an amplitude up to V_dc / √3 [-].

    Notes
    -----
    A voltage that is added to all three legs changes the star centre but no current. This is equivalent to
    space-vector modulation, whose largest voltage is 15 % above that of sine-triangle modulation.

    References
    ----------
    [1] D. G. Holmes, T. A. Lipo: Pulse width modulation for power converters, 2003, section 6.1.
    """
    a, b, c = duty
    return duty - 0.5 * (np.maximum(np.maximum(a, b), c) + np.minimum(np.minimum(a, b), c))


def delay_shares(frequency: Array, step: float) -> tuple[Array, Array]:
    """Return the coefficients by which an averaged model reproduces the delay of a sampled controller.

    The step h of the model may differ from the controller's period T. The lagging voltage is
    y⁺ = y + a (v - y), and (1 - b) y + b v is applied over the step. Its mean delay, (1 - b) h / a + h / 2,
    is set to `CONTROL_DELAY` = 1.5 periods:

        a = h / (1.5 T - h / 2), b = 0   (T ≥ h);   a = 1, b = 1.5 - 1.5 T / h, at most 1   (T < h)

    Parameters
    ----------
    frequency : 1 / T, sampling frequency of the controller, shape (n,) [Hz]
    step : h, step of the model [s]

    Returns
    -------
    a in (0, 1] and b in [0, 1], shape (n,) each [-]; for T = h, a = 1 and b = 0 are exact.
    """
    periods = 1.0 / (np.maximum(frequency, 1.0) * step)
    return (
        np.asarray(1.0 / np.maximum(CONTROL_DELAY * periods - 0.5, 1.0)),
        np.clip(CONTROL_DELAY * (1.0 - periods), 0.0, 1.0),
    )


def delayed(before: Any, demanded: Any, share: Any, at_once: Any) -> Any:
    """Return the voltage applied over a step, (1 - b) y + b v, and the lagging voltage y⁺ = y + a (v - y).

    Parameters
    ----------
    before, demanded : y, lagging voltage before the step; v, voltage that the controller demands [V]
    share, at_once : a, b, from `delay_shares` [-]

    Returns
    -------
    Applied voltage, and y⁺ [V].
    """
    return before + at_once * (demanded - before), before + share * (demanded - before)
