"""Physical meaning of each fault as text."""

import numpy as np

from emaphm.actuator import Actuator, Faults
from emaphm.actuator.quantity import unit_for
from emaphm.diagnosis.verdict import VERDICT


def physical_text(faults: Faults, actuator: Actuator) -> dict[str, str]:
    """Return the physical meaning of each component on `actuator`, with its unit."""
    p = faults.physical(actuator)
    angle = unit_for("rad", actuator.coordinates)
    below_healthy = faults.friction < -VERDICT.healthy_margin
    return {
        "friction": f"dry friction × {p['friction_factor']:.3f}" + ", below healthy" * below_healthy,
        "backlash": f"backlash {p['backlash_rad']:.4g} {angle} at the motor",
        "short_a": f"{100 * p['turns_a']:.1f} % of phase a's turns healthy",
        "short_b": f"{100 * p['turns_b']:.1f} % of phase b's turns healthy",
        "short_c": f"{100 * p['turns_c']:.1f} % of phase c's turns healthy",
        "eccentricity": f"rotor off centre by {100 * p['eccentricity_Z']:.1f} % of the air gap",
        "eccentricity_phase": f"towards {np.degrees(p['eccentricity_phase_rad']):+.1f} deg",
        "gain": f"position gain × {p['gain_factor']:.4f}",
    }
