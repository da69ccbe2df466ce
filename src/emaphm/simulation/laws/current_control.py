"""Proportional-integral control of a current, or of two in d and q, the voltage limited."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.select import clip, select


def limited_pi(error: Any, integral: Any, proportional: Any, integrating: Any, limit: Any, step: Any) -> Any:
    """Return the voltage that a current controller demands, and its integral after the step.

        v = clip(k_p e + x, -V, V),   x⁺ = x + k_i e Δt where v is not limited, or e reduces it, else x

    Parameters
    ----------
    error : e, reference less measured current [A]
    integral : x, integral part before the step [V]
    proportional, integrating : k_p ≥ 0 [V/A], k_i ≥ 0 [V/(A·s)]
    limit : V, largest voltage [V]
    step : Δt, time between two updates of the controller [s]

    Returns
    -------
    v, x⁺ [V].

    Notes
    -----
    Conditional integration: the integral holds while the voltage is limited, so that it does not wind up.

    References
    ----------
    [1] K. J. Åström, T. Hägglund: PID controllers, 2nd ed., 1995, section 3.5.
    """
    wanted = proportional * error + integral
    voltage = clip(wanted, -limit, limit)
    held = (wanted - voltage) * error > 0.0
    return voltage, select(held, integral, integral + integrating * error * step)


def limited_pi_pair(
    error_d: Any,
    error_q: Any,
    integral_d: Any,
    integral_q: Any,
    proportional: Any,
    integrating: Any,
    limit: Any,
    step: Any,
) -> Any:
    """Return the voltages that a controller of the currents in d and q demands, and its integrals after.

        u = k_p e + x,   v = u min(1, V / |u|),   x⁺ = x + k_i e Δt, in d and in q
        x⁺ = x in an axis where |u| > V and u e > 0

    Parameters
    ----------
    error_d, error_q : e, reference less measured current [A]
    integral_d, integral_q : x, integral parts before the step [V]
    proportional, integrating : k_p ≥ 0 [V/A], k_i ≥ 0 [V/(A·s)]
    limit : V, largest voltage, of both axes together [V]
    step : Δt, time between two updates of the controller [s]

    Returns
    -------
    v_d, v_q, x_d⁺, x_q⁺ [V].

    Notes
    -----
    The limit is a circle: a voltage beyond it keeps its direction. The axes are not decoupled. The integral
    of an axis holds while the voltage is limited and its error would drive it further.

    References
    ----------
    [1] S.-K. Sul: Control of electric machine drive systems, 2011, chapter 4.
    """
    wanted_d = proportional * error_d + integral_d
    wanted_q = proportional * error_q + integral_q
    size = np.sqrt(wanted_d * wanted_d + wanted_q * wanted_q)
    share = limit / np.maximum(size, limit)
    rise_d = select(size > limit, select(wanted_d * error_d > 0.0, 0.0, error_d), error_d)
    rise_q = select(size > limit, select(wanted_q * error_q > 0.0, 0.0, error_q), error_q)
    return (
        share * wanted_d,
        share * wanted_q,
        integral_d + integrating * rise_d * step,
        integral_q + integrating * rise_q * step,
    )
