"""Optimisers that evaluate a whole population in one call; a new one is listed in `OPTIMIZERS`."""

from typing import Any

from emaphm.identification.optimizers.base import Optimizer, Result, State, minimise
from emaphm.identification.optimizers.dragonfly import Dragonfly, DragonflyState
from emaphm.identification.optimizers.space_filling import space_filling

OPTIMIZERS: dict[str, type[Optimizer[Any]]] = {"dragonfly": Dragonfly}
"""Every optimiser by the name it has on the command line."""

__all__ = [
    "OPTIMIZERS",
    "Dragonfly",
    "DragonflyState",
    "Optimizer",
    "Result",
    "State",
    "minimise",
    "space_filling",
]
