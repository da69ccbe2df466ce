"""Sampling of a diagnosis's posterior by an ensemble of walkers.

Near a bound, and for the direction of a very small eccentricity, an estimate and its covariance describe the
posterior poorly. Walkers (Goodman and Weare 2010; ter Braak 2006; `emcee`, Foreman-Mackey et al. 2013) then
sample the `LogPosterior`; their steps are simulated in batches.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.posterior.log_posterior import LogPosterior, allowed, forms
from emaphm.estimation.posterior.mcmc_diagnostics import ENOUGH, McmcDiagnostics, library
from emaphm.estimation.posterior.samples import Posterior
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.progress import Progress
from emaphm.random_streams import child_seed, stream
from emaphm.simulation import Model

WIDER = 1.1
"""Factor on the standard deviations of fresh draws, whose tails must not be thinner than the posterior's."""

DRAWS, FEWEST_DRAWS = 4096, 40
"""Number of normal test points, and the least number within the bounds for fresh draws to be efficient."""


@dataclass(frozen=True)
class McmcSettings:
    """Settings of the sampler.

    `walkers` move in two halves, each of which fills the lanes of the batched model; above 16 coordinates
    there are more walkers. `fresh`, `evolution` and `stretch` are the shares of fresh draws from the
    estimate's covariance, of differential evolution and of stretch moves. Fresh draws work for a nearly
    normal posterior, where they decorrelate ten times as fast as the other moves, which always work. (The
    snooker move that is often added to differential evolution gives variances 13 % too small for a normal
    distribution, `emcee` 3.1.6.) Convergence is first checked after `first_check` steps; sampling ends at
    `most_steps` at the latest. The share `burn_in` of the steps is discarded.
    """

    walkers: int = 32
    fresh: float = 0.5
    evolution: float = 0.4
    stretch: float = 0.1
    first_check: int = 500
    most_steps: int = 8000
    burn_in: float = 0.2


MCMC = McmcSettings()

USUAL_STEPS, REPORT_STEPS = 1000, 20
"""Usual number of steps, and number of steps between two reports of progress."""


@dataclass(frozen=True, eq=False)
class FreshDraws:
    """Random points about an estimate `point` (d,), normal with its `covariance` (d, d), within bounds."""

    space: ParameterSpace
    point: Array
    covariance: Array

    def within(self, standard: Array) -> Array:
        """Return the points for `standard` normal numbers (n, d), without those outside the bounds."""
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
        """Return the logarithm of the proposals' density at `points` (n, d), up to a constant, (n,)."""
        return -forms(points - self.point, np.asarray(np.linalg.inv(self.covariance), float)) / (2 * WIDER**2)


def check_posterior(model: Model) -> None:
    """Raise MethodError before a search if its posterior could not be sampled.

    Raises
    ------
    MethodError
        `emcee` is not installed, or the model switches, so that its density is not smooth.
    """
    library()
    if model.switches:
        raise MethodError(
            f"a posterior needs derivatives, which the {model.name} model's switching makes useless; use the "
            "averaged model"
        )


def sample(
    objective: MapObjective,
    point: Array,
    correction: Array,
    covariance: Array,
    seed: int,
    on_progress: Progress | None = None,
    settings: McmcSettings = MCMC,
) -> Posterior:
    """Return samples of the posterior about the estimate `point` (d,) of `objective`.

    Sampling ends when the chains are `ENOUGH` autocorrelation times long, or at the largest number of steps.

    Parameters
    ----------
    objective
        The objective of the search, in the d coordinates of its space.
    point
        The estimate in these coordinates, (d,).
    correction
        Correction that is added to the objective's outputs, shape (rows,).
    covariance
        Covariance of the estimate, shape (d, d), including a normal prior of each coordinate.
    seed
        Seed of the random numbers; the same seed gives the same bits.
    on_progress
        Called with the completed fraction, from 0 to 1.
    settings
        Number and moves of the walkers, and limits of the steps.

    Raises
    ------
    MethodError
        `emcee` is not installed.
    """
    emcee = library()
    space = objective.space
    jacobian_rng = stream(seed, "Jacobians of the posterior")
    density = LogPosterior.of(objective, point, correction, covariance, jacobian_rng)
    walkers = settings.walkers * int(np.ceil(2 * point.size / settings.walkers))
    rng = stream(seed, "walkers")
    moves = [
        (emcee.moves.DEMove(), settings.evolution),
        (emcee.moves.StretchMove(), settings.stretch),
    ]
    draws = FreshDraws(space, point, covariance)
    if len(draws.within(rng.normal(size=(DRAWS, point.size)))) >= FEWEST_DRAWS:
        moves.append((emcee.moves.MHMove(draws), settings.fresh))
    sampler = emcee.EnsembleSampler(walkers, point.size, density, moves=moves, vectorize=True)
    random = np.random.RandomState(child_seed(seed, "moves")).get_state()
    state = emcee.State(_first_positions(space, point, covariance, walkers, rng), random_state=random)
    chain, diagnostics = _run(sampler, state, on_progress, settings)
    if on_progress:
        on_progress(1.0)
    # Neighbouring samples of a chain are nearly equal and add hardly any information.
    thin = max(1, int(np.nanmin([*diagnostics.autocorrelation_time, diagnostics.steps]) / 4))
    return Posterior.of(space, chain[::thin].reshape(-1, point.size), diagnostics)


def _run(
    sampler: Any, state: Any, on_progress: Progress | None, settings: McmcSettings
) -> tuple[Array, McmcDiagnostics]:
    """Return the chain (kept steps, walkers, d) when it has converged, or after the last step."""
    steps, wanted, reported = 0, settings.first_check, 0.0
    while True:
        while steps < wanted:
            state = sampler.run_mcmc(state, REPORT_STEPS, skip_initial_state_check=True)
            steps += REPORT_STEPS
            if on_progress:
                reported = min(max(reported, steps / max(wanted, USUAL_STEPS)), 1.0)
                on_progress(reported)
        chain = sampler.get_chain(discard=int(settings.burn_in * steps))
        acceptance = float(np.mean(sampler.acceptance_fraction))
        diagnostics = McmcDiagnostics.of(chain, acceptance, steps)
        if diagnostics.converged or steps >= settings.most_steps:
            return chain, diagnostics
        wanted = _next_check(diagnostics, settings)


def _first_positions(
    space: ParameterSpace, point: Array, covariance: Array, walkers: int, rng: np.random.Generator
) -> Array:
    """Return the first positions (walkers, d) of the walkers: normal about `point`, reflected at the bounds.

    Several walkers on the same bound could not leave it by moves between them.
    """
    points = rng.multivariate_normal(point, covariance, walkers, method="eigh")
    points = space.lower + np.abs(points - space.lower)
    points = space.upper - np.abs(space.upper - points)
    return space.project(points)


def _next_check(diagnostics: McmcDiagnostics, settings: McmcSettings) -> int:
    """Return the number of steps after which to check convergence again, when it is likely."""
    steps = diagnostics.steps
    longest = float(np.max(diagnostics.autocorrelation_time))
    enough = 1.1 * ENOUGH * longest / (1 - settings.burn_in) if np.isfinite(longest) else 2 * steps
    return int(min(np.clip(enough, 1.2 * steps, 2 * steps), settings.most_steps))
