"""Optimisers that evaluate a whole population in one call; a new one is listed in `OPTIMIZERS`."""

from typing import Any

from emaphm.optimizers.base import Optimizer, Result, State, minimise
from emaphm.optimizers.differential_evolution import (
    DifferentialEvolution,
    DifferentialEvolutionState,
)
from emaphm.optimizers.dragonfly import Dragonfly, DragonflyState
from emaphm.optimizers.genetic import Genetic, GeneticState
from emaphm.optimizers.grey_wolf import GreyWolf, GreyWolfState
from emaphm.optimizers.particle_swarm import ParticleSwarm, ParticleSwarmState
from emaphm.optimizers.random_search import RandomSearch
from emaphm.optimizers.space_filling import space_filling

OPTIMIZERS: dict[str, type[Optimizer[Any]]] = {
    "genetic": Genetic,
    "particle-swarm": ParticleSwarm,
    "differential-evolution": DifferentialEvolution,
    "grey-wolf": GreyWolf,
    "dragonfly": Dragonfly,
    "random": RandomSearch,
}
"""Every optimiser by the name it has on the command line."""

__all__ = [
    "OPTIMIZERS",
    "DifferentialEvolution",
    "DifferentialEvolutionState",
    "Dragonfly",
    "DragonflyState",
    "Genetic",
    "GeneticState",
    "GreyWolf",
    "GreyWolfState",
    "Optimizer",
    "ParticleSwarm",
    "ParticleSwarmState",
    "RandomSearch",
    "Result",
    "State",
    "minimise",
    "space_filling",
]
