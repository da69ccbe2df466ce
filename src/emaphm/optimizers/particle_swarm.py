"""Particle swarm optimisation with constriction."""

import math
from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.optimizers.base import Optimizer, State

REBOUND = -0.5
"""Factor of a velocity component at a bound of the box (Clerc, 2012)."""


@dataclass(frozen=True, eq=False)
class ParticleSwarmState(State):
    """State of a swarm of n particles in d dimensions.

    `velocities`, shape (n, d), are the last steps; `own_points`, shape (n, d), are the best points of each
    particle and `own_fitness`, shape (n,), their fitness.
    """

    velocities: Array
    own_points: Array
    own_fitness: Array


@dataclass(frozen=True, eq=False)
class ParticleSwarm(Optimizer[ParticleSwarmState]):
    """Particle swarm: each particle is attracted by its own best point and by the swarm's best point.

    The particle at X with its own best P and the swarm's best G moves by

        V <- chi (V + c_1 r_1 (P - X) + c_2 r_2 (G - X)),    chi = 2 / (phi - 2 + sqrt(phi² - 4 phi)),

    with phi = c_1 + c_2, and r_1, r_2 uniform in [0, 1], drawn for each particle and component. The
    constriction chi, 0.72984 for the defaults, makes the swarm converge [1]. As in [2], V is at most half the
    box's width in every component ("Vmax = Xmax" on [-Xmax, Xmax]), and the first V are uniform within that.
    A particle that reaches a bound of the box stops there, and the component of V is multiplied by -0.5 [3]:
    with 0 a particle stays at the bound more often, and without a change it is pressed against the bound.

    Parameters
    ----------
    lower, upper, population, iterations
        As in `Optimizer`; [2] has 30 particles.
    cognitive, social
        c_1 and c_2, 2.05 each in [1] and [2].

    Raises
    ------
    MethodError
        As in `Optimizer`; or cognitive or social is negative, or their sum is not finite or not above 4,
        where chi is not defined.

    References
    ----------
    .. [1] M. Clerc and J. Kennedy, "The particle swarm: explosion, stability, and convergence in a
       multidimensional complex space", IEEE Transactions on Evolutionary Computation 6, 2002.
    .. [2] R. C. Eberhart and Y. Shi, "Comparing inertia weights and constriction factors in particle swarm
       optimization", Congress on Evolutionary Computation, 2000.
    .. [3] M. Clerc, "Standard particle swarm optimisation", HAL hal-00764996, 2012.
    """

    cognitive: float = 2.05
    social: float = 2.05

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, value in (("cognitive", self.cognitive), ("social", self.social)):
            if not value >= 0:
                raise MethodError(f"{name} must be at least 0, got {value:g}")
        phi = self.cognitive + self.social
        if not 4 < phi < math.inf:
            raise MethodError(f"cognitive + social must be above 4 and finite, got {phi:g}")

    @property
    def constriction(self) -> float:
        """Constriction factor chi [1]."""
        phi = self.cognitive + self.social
        return 2 / (phi - 2 + math.sqrt(phi * (phi - 4)))

    def init(self, seed: int) -> ParticleSwarmState:
        """Return a random swarm with random velocities."""
        rng = self._random(seed, 0)
        positions = self._scatter(rng)
        return self._start(
            ParticleSwarmState,
            seed,
            positions,
            velocities=(rng.random(positions.shape) - 0.5) * (self.upper - self.lower),
            own_points=positions,
            own_fitness=np.full(self.population, np.inf),
        )

    def _move(self, state: ParticleSwarmState, fitness: Array) -> ParticleSwarmState:
        better = fitness < state.own_fitness
        own_points = np.where(better[:, None], state.positions, state.own_points)
        longest = (self.upper - self.lower) / 2
        r = self._random(state.seed, state.iteration).random((2, *state.positions.shape))
        own_pull = self.cognitive * r[0] * (own_points - state.positions)
        best_pull = self.social * r[1] * (state.best_point - state.positions)
        velocities = self.constriction * (state.velocities + own_pull + best_pull)
        unbounded = state.positions + np.clip(velocities, -longest, longest, out=velocities)
        positions = np.clip(unbounded, self.lower, self.upper)
        velocities[unbounded != positions] *= REBOUND
        return replace(
            state,
            positions=positions,
            velocities=velocities,
            own_points=own_points,
            own_fitness=np.minimum(fitness, state.own_fitness),
        )
