"""The drive's inner loop: from the speed error to a limited reference current."""

from typing import Any

from emaphm.simulation.laws.select import clip


def current_demand(
    error: Any,
    integral: Any,
    difference: Any,
    proportional: Any,
    integrating: Any,
    derivative: Any,
    limit: Any,
) -> Any:
    """Return the reference current: PID on the speed error, limited.

        i_ref = clip((GAP e + GAI ∫e dt + GAD de/dt) / k_t, -I_max, I_max)

    with the gains already divided by the torque constant that the drive assumes, and the derivative taken
    as the difference over one step.

    Parameters
    ----------
    error : e, speed error [rad/s]
    integral : Σ e Δt over the steps before this one [rad]
    difference : e less its value a step before [rad/s]
    proportional : GAP / k_t [A·s/rad]
    integrating : GAI / k_t [A/rad]
    derivative : GAD / (k_t Δt) [A·s/rad]
    limit : I_max, largest reference current [A]

    Returns
    -------
    i_ref, reference current [A].

    Notes
    -----
    The integral goes on growing while the current is limited: there is no anti-windup. In the thesis's
    actuator the integral and derivative gains are 0.

    References
    ----------
    [1] Thesis, section 3.1.2, Fig. 3.3; gains in Tab. 3.1.
    """
    return clip(proportional * error + integrating * integral + derivative * difference, -limit, limit)
