"""Proportional-integral control, with limited voltage, of one current or of the currents in d and q."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.select import clip, select


def limited_pi(error: Any, integral: Any, proportional: Any, integrating: Any, limit: Any, step: Any) -> Any:
    """Return the voltage demand of a current controller, and its integral part after the step.

        u = k_p e + x,   v = clip(u, -V, V)
        x⁺ = x              ((u - v) e > 0: the voltage is limited, and the error would drive it further)
        x⁺ = x + k_i e Δt   (otherwise)

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
    Conditional integration prevents wind-up.

    References
    ----------
    [1] K. J. Åström, T. Hägglund: PID controllers, 2nd ed., 1995, section 3.5.
    """
    unlimited = proportional * error + integral
    voltage = clip(unlimited, -limit, limit)
    held = (unlimited - voltage) * error > 0.0
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
    """Return the voltage demand of a controller of the currents in d and q, and its integral parts after.

    In d and in q, with |u| = √(u_d² + u_q²):

        u = k_p e + x,   v = u min(1, V / |u|)
        x⁺ = x              (|u| > V, and u e > 0 in this axis)
        x⁺ = x + k_i e Δt   (otherwise)

    Parameters
    ----------
    error_d, error_q : e, reference less measured current [A]
    integral_d, integral_q : x, integral parts before the step [V]
    proportional, integrating : k_p ≥ 0 [V/A], k_i ≥ 0 [V/(A·s)]
    limit : V, largest length of the voltage vector [V]
    step : Δt, time between two updates of the controller [s]

    Returns
    -------
    v_d, v_q, x_d⁺, x_q⁺ [V].

    Notes
    -----
    The limit is a circle: a limited voltage keeps its direction. The axes are not decoupled. Conditional
    integration in each axis prevents wind-up.

    References
    ----------
    [1] S.-K. Sul: Control of electric machine drive systems, 2011, chapter 4.
    """
    unlimited_d = proportional * error_d + integral_d
    unlimited_q = proportional * error_q + integral_q
    size = np.sqrt(unlimited_d * unlimited_d + unlimited_q * unlimited_q)
    share = limit / np.maximum(size, limit)
    rise_d = select(size > limit, select(unlimited_d * error_d > 0.0, 0.0, error_d), error_d)
    rise_q = select(size > limit, select(unlimited_q * error_q > 0.0, 0.0, error_q), error_q)
    return (
        share * unlimited_d,
        share * unlimited_q,
        integral_d + integrating * rise_d * step,
        integral_q + integrating * rise_q * step,
    )
