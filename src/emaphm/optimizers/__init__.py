"""Optimisers that evaluate a population in one call; those of this package are listed in `OPTIMIZERS`."""

from typing import Any

from emaphm.optimizers.base import Optimizer, State
from emaphm.optimizers.differential_evolution import DifferentialEvolution
from emaphm.optimizers.dragonfly import Dragonfly
from emaphm.optimizers.genetic import Genetic
from emaphm.optimizers.grey_wolf import GreyWolf
from emaphm.optimizers.minimiser import BestSoFar, Fitness, Minimiser, OnPopulation, Result
from emaphm.optimizers.particle_swarm import ParticleSwarm
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
"""Optimisers of this package by their names on the command line."""

__all__ = [
    "OPTIMIZERS",
    "BestSoFar",
    "DifferentialEvolution",
    "Dragonfly",
    "Fitness",
    "Genetic",
    "GreyWolf",
    "Minimiser",
    "OnPopulation",
    "Optimizer",
    "ParticleSwarm",
    "RandomSearch",
    "Result",
    "State",
    "space_filling",
]
