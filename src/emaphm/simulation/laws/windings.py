"""Currents in the windings: three phases in a star with a floating centre, and one equivalent winding."""

from typing import Any

from emaphm.simulation.laws.inline import law


@law
def star_slopes(
    drive_a: Any, drive_b: Any, drive_c: Any, inverse_a: Any, inverse_b: Any, inverse_c: Any
) -> Any:
    """Return the slopes of the three phase currents [A/s].

    drive_i = v_i - R_i i_i - e_i is what is left of the leg's voltage [V]; inverse_i = 1 / L_i [1/H].
    The centre takes the voltage that keeps the sum of the currents at zero.
    """
    weighted = drive_a * inverse_a + drive_b * inverse_b + drive_c * inverse_c
    centre = weighted / (inverse_a + inverse_b + inverse_c)
    return (drive_a - centre) * inverse_a, (drive_b - centre) * inverse_b, (drive_c - centre) * inverse_c


@law
def winding_current(current: Any, voltage: Any, conductance: Any, decay: Any) -> Any:
    """Return the current [A] after a step under constant `voltage` [V]: first order, exact.

    `conductance` = 1 / R [S], `decay` = exp(-step R / L).
    """
    final = voltage * conductance
    return final + (current - final) * decay
