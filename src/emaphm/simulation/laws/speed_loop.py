"""Speed loop of the drive: from the speed error to a limited reference current."""

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
    """Return the reference current: limited PID control of the speed error.

        i_ref = clip((GAP e + GAI ∫e dt + GAD de/dt) / k_t, -I_max, I_max)

    k_t is the torque constant that the drive assumes; the gains below include it. The derivative is the
    difference over one step.

    Parameters
    ----------
    error : e, speed error [rad/s]
    integral : Σ e Δt over the previous steps [rad]
    difference : e less its value one step before [rad/s]
    proportional : GAP / k_t [A·s/rad]
    integrating : GAI / k_t [A/rad]
    derivative : GAD / (k_t Δt) [A·s/rad]
    limit : I_max, largest reference current [A]

    Returns
    -------
    i_ref, reference current [A].

    Notes
    -----
    No anti-windup: the integral continues to grow while the current is limited. In the thesis's actuator the
    integral and derivative gains are 0.

    References
    ----------
    [1] Thesis, section 3.1.2, Fig. 3.3; gains in Tab. 3.1.
    """
    return clip(proportional * error + integrating * integral + derivative * difference, -limit, limit)
