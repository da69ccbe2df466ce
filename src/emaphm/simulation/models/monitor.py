"""Monitor model of the thesis (3.2, 4.4, 4.5): one phase, switched by the sign of the current error."""

from functools import cache
from typing import Literal

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import MethodError, nearest
from emaphm.simulation.engine.model import Model
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.models import single_winding


def printed_shorts(plant: Plant, step: float) -> dict[str, Array]:
    """Return the kernel's parameters R N, L N², k N with N = (N_a + N_b + N_c) / 3 at any angle."""
    mean = np.broadcast_to(plant.turns.mean(axis=0), plant.turns.shape)
    return single_winding.parameters(plant, step, mean, mean**2, mean)


def modulated_shorts(plant: Plant, step: float) -> dict[str, Array]:
    """Return the kernel's parameters with N the mean of the two conducting phases: f(θ) of thesis 4.4."""
    pairs = single_winding.of_pairs(plant.turns) / 2
    return single_winding.parameters(plant, step, pairs, pairs**2, plant.turns)


SHORTS = {"printed": printed_shorts, "modulated": modulated_shorts}
ECCENTRICITIES = ("reference", "printed")


@cache
def monitor(
    shorts: Literal["printed", "modulated"] = "printed",
    eccentricity: Literal["reference", "printed"] = "reference",
) -> Model:
    """Return the monitor model with the given forms of short circuit and eccentricity.

    `printed` selects the thesis's formulas; `modulated` makes shorts depend on the rotor's sector;
    `reference` is the eccentricity of the reference model, with one period per mechanical turn.

    Raises
    ------
    MethodError
        A form is unknown.
    """
    for given, known in ((shorts, SHORTS), (eccentricity, ECCENTRICITIES)):
        if given not in known:
            raise MethodError(f"unknown form '{given}' of the monitor model{nearest(given, known)}")
    default = (shorts, eccentricity) == ("printed", "reference")
    return Model(
        "monitor" if default else f"monitor ({shorts} shorts, {eccentricity} eccentricity)",
        1e-5,
        {
            "hysteresis": single_winding.form(
                SHORTS[shorts],
                "hysteresis",
                averaged=False,
                printed_eccentricity=eccentricity == "printed",
            )
        },
        switches=True,
    )
