"""Sampling the posterior of a diagnosis by an ensemble of walkers.

Beside a bound, or in the direction of an eccentricity that is hardly there, an estimate and its covariance
say too little. Walkers (Goodman and Weare 2010; ter Braak 2006; `emcee`, Foreman-Mackey et al. 2013) then
sample the `Density`, their steps simulated in batches.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.estimation.log_posterior import Density, allowed, forms
from emaphm.estimation.mcmc_diagnostics import ENOUGH, Convergence, library
from emaphm.estimation.objective import Fit
from emaphm.estimation.parameter_space import FaultSpace
from emaphm.estimation.posterior import Posterior
from emaphm.optimizers.base import generator
from emaphm.simulation import Model

WALKERS = 32
"""In two halves, each of which fills the lanes of the batched model; more beyond 16 coordinates."""

MOVES = (0.5, 0.4, 0.1)
"""Shares of fresh draws from the estimate's covariance, differential evolution, and stretches.

The first serve where the posterior is nearly normal, and there decorrelate ten times as fast as the others,
which serve anywhere. The snooker move that is often added to differential evolution leaves variances 13 % too
small on a normal distribution (`emcee` 3.1.6).
"""

WIDER = 1.1
"""Standard deviations of fresh draws, as a multiple: their tails should not be the thinner ones."""

DRAWS, FEWEST = 4096, 40
"""Normal points drawn to see how many lie within the bounds, and how many must for fresh draws to pay."""

FIRST_CHECK, MOST_STEPS = 500, 8000
"""Steps before convergence is looked at for the first time, and those after which sampling ends anyway."""

USUAL_STEPS, PACE = 1000, 20
"""Steps that most recordings take, and those between two reports of progress."""

BURN_IN = 0.2
"""Share of the steps at the beginning that is not used."""


@dataclass(frozen=True, eq=False)
class Draws:
    """Fresh points, normal about an estimate `point` (d,) with its `covariance` (d, d), and within bounds."""

    space: FaultSpace
    point: Array
    covariance: Array

    def within(self, standard: Array) -> Array:
        """Return what standard normal (n, d) points become, those outside of the bounds left out."""
        points = self.point + WIDER * standard @ np.linalg.cholesky(self.covariance).T
        return points[allowed(self.space, points)]

    def __call__(self, points: Array, random: np.random.RandomState) -> tuple[Array, Array]:
        """Return a proposal for each of `points` (n, d), and the logarithm of its correction, (n,)."""
        drawn = np.empty((0, points.shape[1]))
        while len(drawn) < len(points):
            drawn = np.concatenate(
                [drawn, self.within(random.standard_normal((DRAWS // 4, points.shape[1])))]
            )
        proposed = drawn[: len(points)]
        return proposed, self._density(points) - self._density(proposed)

    def _density(self, points: Array) -> Array:
        return -forms(points - self.point, np.asarray(np.linalg.inv(self.covariance), float)) / (2 * WIDER**2)


def check_posterior(model: Model) -> None:
    """Refuse what cannot be sampled, before the search that it would be lost with.

    Raises
    ------
    MethodError
        `emcee` is not installed, or the model switches: its density would be as rough as that chaos.
    """
    library()
    if model.switches:
        raise MethodError(
            f"a posterior needs derivatives, which drown in the {model.name} model's switching; use the "
            "averaged model"
        )


def sample(
    fit: Fit,
    point: Array,
    correction: Array,
    covariance: Array,
    seed: int,
    on_progress: Callable[[float], None] | None = None,
) -> Posterior:
    """Return samples of the posterior of `fit` about the estimate `point` (d,).

    Sampling ends by itself once the chains are `ENOUGH` autocorrelation times long, or at `MOST_STEPS`.

    Parameters
    ----------
    correction
        Added to the outputs of `fit`, shape (rows,).
    covariance
        Of the estimate, shape (d, d), a normal prior of each coordinate being part of it.
    seed
        The same seed gives the same bits.
    on_progress
        Called with the fraction done, from 0 to 1.

    Raises
    ------
    MethodError
        `emcee` is not installed.
    """
    emcee = library()
    density = Density.of(fit, point, correction, covariance, seed)
    walkers = WALKERS * int(np.ceil(2 * point.size / WALKERS))
    rng = generator(seed, 2)
    fresh, evolution, stretches = MOVES
    moves = [(emcee.moves.DEMove(), evolution), (emcee.moves.StretchMove(), stretches)]
    draws = Draws(fit.space, point, covariance)
    if len(draws.within(rng.normal(size=(DRAWS, point.size)))) >= FEWEST:
        moves.append((emcee.moves.MHMove(draws), fresh))
    sampler = emcee.EnsembleSampler(walkers, point.size, density, moves=moves, vectorize=True)
    random = np.random.RandomState(int(rng.integers(2**32))).get_state()
    state = emcee.State(_started(fit.space, point, covariance, walkers, rng), random_state=random)
    steps, wanted, told = 0, FIRST_CHECK, 0.0
    while True:
        while steps < wanted:
            state = sampler.run_mcmc(state, PACE, skip_initial_state_check=True)
            steps += PACE
            if on_progress:
                told = min(max(told, steps / max(wanted, USUAL_STEPS)), 1.0)
                on_progress(told)
        chain = sampler.get_chain(discard=int(BURN_IN * steps))
        convergence = Convergence.of(chain, float(np.mean(sampler.acceptance_fraction)), steps)
        if convergence.converged or steps >= MOST_STEPS:
            break
        wanted = _wanted(convergence)
    if on_progress:
        on_progress(1.0)
    # Neighbours in a chain are nearly the same, and hardly add to what is known.
    thin = max(1, int(np.nanmin([*convergence.autocorrelation_time, steps]) / 4))
    samples = chain[::thin].reshape(-1, point.size)
    return Posterior.of(fit.space, samples, convergence, density.evaluations)


def _started(
    space: FaultSpace, point: Array, covariance: Array, walkers: int, rng: np.random.Generator
) -> Array:
    """Return where the walkers start, (walkers, d): normal about `point` (d,), reflected at the bounds.

    Those put onto a bound would share it, and no move between them leave it.
    """
    points = rng.multivariate_normal(point, covariance, walkers, method="eigh")
    points = space.lower + np.abs(points - space.lower)
    points = space.upper - np.abs(space.upper - points)
    return space.project(points)


def _wanted(convergence: Convergence) -> int:
    """Return the steps after which to look at convergence again: when it may do, soon if unclear."""
    steps = convergence.steps
    longest = float(np.max(convergence.autocorrelation_time))
    enough = 1.1 * ENOUGH * longest / (1 - BURN_IN) if np.isfinite(longest) else 2 * steps
    return int(min(np.clip(enough, 1.2 * steps, 2 * steps), MOST_STEPS))
