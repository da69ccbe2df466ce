"""Averaged model, used for identification: without current ripple, so that its step may be 50 µs."""

from emaphm.arrays import Array
from emaphm.simulation.engine.model import Model
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.models import single_winding
from emaphm.simulation.models.foc_averaged import FOC_AVERAGED


def parameters(plant: Plant, step: float) -> dict[str, Array]:
    """Return the kernel's parameters with faults by phase, so that a short can be located, (n,) each.

    For the conducting phases i, j:

        R = (R_s / 2)(N_i + N_j),  L = (L_s / 2)(N_i² + N_j²),  k = (k_e / 2)(N_i g_i + N_j g_j)
    """
    pairs, squares = single_winding.of_pairs(plant.turns) / 2, single_winding.of_pairs(plant.turns**2) / 2
    return single_winding.parameters(plant, step, pairs, squares, plant.turns)


SINGLE_WINDING = {
    drive: single_winding.form(parameters, drive)
    for drive in ("hysteresis", "current", "voltage", "six-step")
}
"""Forms with one equivalent winding, by kind of drive."""

AVERAGED = Model("averaged", 5e-5, {**SINGLE_WINDING, "foc": FOC_AVERAGED})
"""Averaged model with its step of 50 µs."""
