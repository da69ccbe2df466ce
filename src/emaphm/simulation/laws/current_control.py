"""Proportional-integral control of a current, its voltage limited."""

from typing import Any

from emaphm.simulation.laws.inline import clip, law, select


@law
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
