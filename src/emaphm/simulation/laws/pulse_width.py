"""Pulse-width modulation: three legs that a triangular carrier switches."""

from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.select import clip, select

CONTROL_DELAY = 1.5
"""Periods from sampling the currents to the middle of the period in which the answer is applied."""


def carrier_after(phase: Any, step_per_period: Any) -> Any:
    """Return how far the carrier is in its period after a step.

        p⁺ = p + Δt f, less 1 where p + Δt f > 1 - Δt f / 2

    Parameters
    ----------
    phase : p, in [-Δt f / 2, 1 - Δt f / 2); a period begins in the step in which p < Δt f / 2 [-]
    step_per_period : Δt f, of the step to the period [-]

    Returns
    -------
    p⁺, in the same range [-].

    Notes
    -----
    Periods begin at the step that is nearest, and keep their frequency: roundings do not add up.
    """
    following = phase + step_per_period
    return select(following > 1.0 - 0.5 * step_per_period, following - 1.0, following)


def triangle(phase: Any, step_per_period: Any) -> Any:
    """Return the carrier in the middle of a step: from +1 down to -1 halfway through the period, and back.

        c = 4 |p + Δt f / 2 - 1/2| - 1

    Parameters
    ----------
    phase : p, at the step's start [-]
    step_per_period : Δt f [-]

    Returns
    -------
    c, in [-1, 1] [-].
    """
    return 4.0 * np.abs(phase + 0.5 * step_per_period - 0.5) - 1.0


def leg_mean(duty: Any, carrier: Any, step_per_period: Any) -> Any:
    """Return the mean state of a leg over a step: +1 while its duty is above the carrier, else -1.

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
    Exact where the carrier does not turn within the step: a leg that switches within it has the voltage-time
    area of the true instant, so that the step does not round the duty. No dead time, no voltage drop.
    """
    return clip((duty - carrier) / (2.0 * step_per_period), -1.0, 1.0)


def half_ripple(supply: Any, duty: Any, per_volt: Any) -> Any:
    """Return by how much the current swings about its mean while two legs switch to opposite rails.

        ΔI / 2 = V (1 - d²) / (4 L f)

    Parameters
    ----------
    supply : V [V]
    duty : d, mean voltage of the pair relative to the supply, in [-1, 1] [-]
    per_volt : 1 / (4 L f), L of the pair and f of the carrier [A/V]

    Returns
    -------
    ΔI / 2, half of peak to peak [A].

    Notes
    -----
    Of a current that is nearly a triangle: the period is short against L / R.
    """
    return supply * (1.0 - duty * duty) * per_volt


def centred(duty: Phases) -> Any:
    """Return three duties moved so that the largest and the smallest are as far from 0.

        m_i' = m_i - (max m + min m) / 2

    Parameters
    ----------
    duty : m_i = 2 v_i / V_dc, v_i the phase voltages to be made [-]

    Returns
    -------
    m_i', within [-1, 1] for balanced voltages of an amplitude up to V_dc / √3 [-].

    Notes
    -----
    What is added to all three legs moves the star's centre and no current. It is what space-vector
    modulation does, which reaches 15 % more than a plain sine and triangle.

    References
    ----------
    [1] D. G. Holmes, T. A. Lipo: Pulse width modulation for power converters, 2003, section 6.1.
    """
    a, b, c = duty
    return duty - 0.5 * (np.maximum(np.maximum(a, b), c) + np.minimum(np.minimum(a, b), c))


def delay_shares(frequency: Array, step: float) -> tuple[Array, Array]:
    """Return how an averaged model makes the delay of a sampled controller at a step of its own.

    The controller's voltage is y⁺ = y + a (v - y), and (1 - b) y + b v is applied over the step. The mean
    delay of that, (1 - b) h / a + h / 2, is to be `CONTROL_DELAY` periods T:

        a = h / (1.5 T - h / 2), b = 0   (T ≥ h);   a = 1, b = 1.5 - 1.5 T / h, at most 1   (T < h)

    Parameters
    ----------
    frequency : 1 / T, of the controller, shape (n,) [Hz]
    step : h [s]

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
    """Return the voltage that is applied over a step, and the lagging one after it; see `delay_shares`.

    Parameters
    ----------
    before, demanded : y, v [V]
    share, at_once : a, b [-]

    Returns
    -------
    (1 - b) y + b v, y⁺ [V].
    """
    return before + at_once * (demanded - before), before + share * (demanded - before)
