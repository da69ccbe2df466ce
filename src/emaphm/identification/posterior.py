"""Sampling the faults that a recording leaves possible, where a normal distribution does not describe them.

Beside a bound, or in the direction of an eccentricity that is hardly there, an estimate and its covariance
say too little. The posterior is then sampled by an ensemble of walkers (Goodman and Weare 2010; ter Braak
2006; `emcee`, Foreman-Mackey et al. 2013), whose steps are simulated in batches.

Before the recording, the faults are spread evenly over their box and the eccentricity over its disk; the
nuisances have their normal priors. The likelihood is a normal one. White residuals would make it far too
sure: those of a good fit are correlated over milliseconds (see `emaphm.identification.uncertainty`). Its
residual covariance is therefore the one under which least squares are efficient and know exactly what
the sandwich says that they know (Müller 2013 has the sandwich as posterior covariance; Kruskal 1968 when least
squares are efficient): with G (d, rows) the derivatives at the estimate, I = G Gᵀ, W the information
(d, d) in the estimate's covariance, and s² the mean square of the residual r there,

    log L = -½ Δᵀ W Δ - ½ |r - GᵀΔ|² / (c s²),    Δ = I⁻¹ G r,

in which Δ is the Gauss-Newton step that r still asks for. What no step can take away counts besides, c rows
as one (c = `CORRELATED_ROWS`: a magnitude adjustment, Pauli et al. 2011; Ribatet et al. 2012). Where the model
is linear that part is constant, and the posterior is the normal one of the covariance, cut by the bounds.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import NAMES
from emaphm.errors import MethodError
from emaphm.identification.correction import PRIOR_DEVIATION
from emaphm.identification.fit import CORRELATED_ROWS, Fit
from emaphm.identification.nuisance import RANGE
from emaphm.identification.optimizers.base import generator
from emaphm.identification.refinement import information, scattered
from emaphm.identification.space import FaultSpace
from emaphm.simulation import Model

Array = NDArray[np.float64]

WALKERS = 32
"""In two halves, each of which fills the lanes of the batched model; multiples of it beyond 16 coordinates."""

STRETCHES = 0.1
"""Share of stretch moves among those of differential evolution.

The latter decorrelate three times as fast in ten dimensions; the former take steps of every length. The
snooker move that is often added leaves variances 13 % too small on a normal distribution (`emcee` 3.1.6).
"""

FIRST_CHECK, MOST_STEPS = 500, 8000
"""Steps before convergence is looked at for the first time, and those after which sampling ends anyway."""

USUAL_STEPS, PACE = 3000, 20
"""Steps that most recordings take, and those between two reports of progress."""

BURN_IN = 0.2
"""Share of the steps at the beginning that is not used."""

ENOUGH = 50
"""Autocorrelation times in a chain from which on they can be relied on themselves (`emcee`'s own advice)."""

MOST_R_HAT = 1.05
"""A chain of `ENOUGH` autocorrelation times is expected at 1.02: its halves have 25 each."""

DERIVATIVE_STEP, DERIVATIVES = 1e-2, 8
"""Step of the differences that derivatives at the estimate are taken by, and how often."""

HARDLY_LONGER = 0.02
"""An interval that begins at a bound may be longer by this, about the Monte Carlo error of a length."""

WHOLE_CIRCLE = 0.9
"""A direction whose interval is longer than this share of a turn may be any."""

MATERIAL, LEAST_DIFFERENCE = 0.25, 5e-3
"""Two intervals differ if an end moves by more than this share of the longer, and by more than half a percent."""


@dataclass(frozen=True, eq=False)
class Convergence:
    """Whether the walkers can be relied on.

    `autocorrelation_time` (d,) [steps], `effective_samples` (d,) and `r_hat` (d,), of the split chains of all
    walkers (Gelman et al. 2013), are those of each estimator coordinate; `acceptance` is the share of
    proposals taken, and `steps` those of each walker, burn-in included.
    """

    autocorrelation_time: Array
    effective_samples: Array
    r_hat: Array
    acceptance: float
    steps: int
    converged: bool

    @classmethod
    def of(cls, chain: Array, acceptance: float, steps: int) -> Self:
        """Return what `chain` (kept steps, walkers, d) shows of itself."""
        kept, walkers, _ = chain.shape
        times, r_hat = autocorrelation_time(chain), split_r_hat(chain)
        # A walker that never moved has no autocorrelation time; comparisons with nan are false.
        converged = bool(np.all(kept > ENOUGH * times) and np.all(r_hat < MOST_R_HAT))
        return cls(times, kept * walkers / times, r_hat, acceptance, steps, converged)

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm diagnose --posterior --json` prints of it."""
        return {
            "converged": self.converged,
            "steps": self.steps,
            "acceptance": self.acceptance,
            "autocorrelation_time": _finite(self.autocorrelation_time),
            "effective_samples": _finite(self.effective_samples),
            "r_hat": _finite(self.r_hat),
        }

    def __str__(self) -> str:
        """Return one sentence."""
        if self.converged:
            return (
                f"{np.min(self.effective_samples):.0f} effective samples or more, "
                f"R-hat {np.max(self.r_hat):.3f} at most, {100 * self.acceptance:.0f} % of proposals accepted"
            )
        return (
            f"has NOT converged in {self.steps} steps (R-hat up to {np.max(self.r_hat):.2f}, "
            f"{100 * self.acceptance:.0f} % of proposals accepted): do not rely on it; fix nuisances that are known, "
            "record more channels or a longer manoeuvre"
        )


def _finite(values: Array) -> list[float | None]:
    """Return `values` (n,) as JSON can hold them."""
    return [float(value) if np.isfinite(value) else None for value in values]


@dataclass(frozen=True, eq=False)
class Posterior:
    """Samples of what a recording leaves possible.

    `samples` (n, d) are in estimator coordinates, `components` (n, 8) normalised faults. `interval95` and
    `median` are those of each component; a direction's may run past 0 or 1, where the circle closes.
    """

    samples: Array
    components: Array
    interval95: Mapping[str, tuple[float, float]]
    median: Mapping[str, float]
    convergence: Convergence

    @classmethod
    def of(cls, space: FaultSpace, samples: Array, convergence: Convergence) -> Self:
        """Return the posterior that `samples` (n, d) of `space` are drawn from."""
        components = space.faults(samples)
        intervals, medians = {}, {}
        for name, values in zip(NAMES, components.T, strict=True):
            if name in space.fixed:
                intervals[name], medians[name] = (0.0, 1.0), float(values[0])
            elif name == "eccentricity_phase":
                intervals[name], medians[name] = arc(values)
            else:
                power = 2 if name == "eccentricity" else 1
                intervals[name], medians[name] = interval(values, power), float(np.median(values))
        return cls(samples, components, intervals, medians, convergence)

    def differing(self, intervals: Mapping[str, tuple[float, float]]) -> tuple[str, ...]:
        """Return the components whose interval is materially another than in `intervals`."""
        return tuple(name for name, mine in self.interval95.items() if _differ(name, mine, intervals[name]))

    def notes(self, intervals: Mapping[str, tuple[float, float]]) -> list[str]:
        """Return a line on convergence, and one for each component that `intervals` say otherwise of."""
        state = str(self.convergence)
        lines = [f"Sampled posterior: {state}." if self.convergence.converged else f"The posterior {state}."]
        for name in self.differing(intervals):
            (low, high), (least, most) = self.interval95[name], intervals[name]
            lines.append(
                f"{name}: {low:.4f} to {high:.4f} sampled (median {self.median[name]:.4f}), "
                f"{least:.4f} to {most:.4f} as a normal estimate."
            )
        return lines

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm diagnose --posterior --json` prints of it."""
        faults = {
            name: {"median": self.median[name], "interval95": list(self.interval95[name])} for name in NAMES
        }
        return {"faults": faults, "samples": len(self.samples), "convergence": self.convergence.to_dict()}


def _differ(name: str, one: tuple[float, float], other: tuple[float, float]) -> bool:
    turns = (-1, 0, 1) if name == "eccentricity_phase" else (0,)
    moved = min(max(abs(one[0] - other[0] - turn), abs(one[1] - other[1] - turn)) for turn in turns)
    longer = max(one[1] - one[0], other[1] - other[0])
    return moved > max(MATERIAL * longer, LEAST_DIFFERENCE)


def interval(values: Array, power: int = 1) -> tuple[float, float]:
    """Return the shortest interval that holds 95 % of `values` (n,) in [0, 1].

    It is shortest in `values` to a power: in the eccentricity's square, in which its prior is even, so that
    0 is not left out merely because a disk has little area about its centre. One that begins or ends at
    a bound is taken where it is `HARDLY_LONGER`.
    """
    ordered = np.sort(values) ** power
    held = int(np.ceil(0.95 * ordered.size))
    lengths = ordered[held - 1 :] - ordered[: ordered.size - held + 1]
    first = int(np.argmin(lengths))
    ends = (float(ordered[first]), float(ordered[first + held - 1]))
    most = (1 + HARDLY_LONGER) * float(lengths[first])
    for at_bound in ((0.0, float(ordered[held - 1])), (float(ordered[-held]), 1.0)):
        if at_bound[1] - at_bound[0] <= most:
            ends, most = at_bound, at_bound[1] - at_bound[0]
    return ends[0] ** (1 / power), ends[1] ** (1 / power)


def arc(turns: Array) -> tuple[tuple[float, float], float]:
    """Return the shortest arc that holds 95 % of `turns` (n,) in [0, 1], and the median counted along it.

    It may run past 1; where it is longer than `WHOLE_CIRCLE`, it is (0, 1).
    """
    ordered = np.sort(turns)
    held = int(np.ceil(0.95 * ordered.size))
    around = np.concatenate([ordered, ordered + 1])
    lengths = around[held - 1 : held - 1 + ordered.size] - ordered
    first = int(np.argmin(lengths))
    # What is left out lies opposite the arc's middle: there the circle is cut open.
    cut = ordered[first] + lengths[first] / 2 - 0.5
    median = float((cut + np.median((turns - cut) % 1)) % 1)
    if lengths[first] > WHOLE_CIRCLE:
        return (0.0, 1.0), median
    low, high = float(ordered[first]), float(ordered[first] + lengths[first])
    return (low, high), median + (1.0 if median < low else 0.0)


def autocorrelation_time(chain: Array) -> Array:
    """Return the integrated autocorrelation time (d,) [steps] of `chain` (steps, walkers, d); nan if it stands."""
    with np.errstate(invalid="ignore"):
        times = library().autocorr.integrated_time(chain, tol=0)
    return np.asarray(times, float)


def split_r_hat(chain: Array) -> Array:
    """Return R-hat (d,) of the halves of each walker's `chain` (steps, walkers, d); infinite if it stands.

    The root of the variance of all over that within: Gelman et al. (2013), section 11.4.
    """
    half = len(chain) // 2
    halves = np.concatenate([chain[:half], chain[half : 2 * half]], axis=1)
    within = halves.var(axis=0, ddof=1).mean(axis=0)
    between = halves.mean(axis=0).var(axis=0, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(within > 0, (half - 1) / half + between / within, np.inf)
    return np.asarray(np.sqrt(ratio))


@dataclass(frozen=True, eq=False)
class Density:
    """The logarithm of the posterior density, up to a constant; see the top of this file.

    `correction` (rows,) is added to the outputs of `fit`; `derivatives` (d, rows) and `step` (d, rows), which
    takes a residual to its Gauss-Newton step, are those at the estimate.
    """

    fit: Fit
    correction: Array
    derivatives: Array
    step: Array
    information: Array
    variance: float

    @classmethod
    def of(cls, fit: Fit, point: Array, correction: Array, covariance: Array, seed: int) -> Self:
        """Return the density whose curvature at `point` (d,) is what `covariance` (d, d) says."""
        rows = fit.recorded_rows
        several, _ = scattered(
            lambda points: fit.outputs(points)[:, :rows], point, fit.space, DERIVATIVE_STEP, DERIVATIVES, seed
        )
        derivatives = several.mean(axis=0)
        step = np.linalg.pinv(information(several), rcond=1e-9, hermitian=True) @ derivatives
        outputs = fit.outputs(point[np.newaxis])[0] + correction
        # A perfect fit would leave nothing to weigh by: rounding leaves at least this much residual.
        least = 1e-20 * float(np.mean(outputs**2)) + np.finfo(float).tiny ** 0.25
        variance = max(float(np.mean((fit.target - outputs)[:rows] ** 2)), least)
        faults = np.arange(point.size) < len(fit.space.columns)
        # The covariance allows for a normal prior of every coordinate: what is left is the recording's.
        known = np.linalg.inv(covariance) - np.diag(np.where(faults, PRIOR_DEVIATION**-2, RANGE**2))
        values, axes = np.linalg.eigh((known + known.T) / 2)
        told = axes * np.maximum(values, 0.0) @ axes.T
        return cls(fit, correction[:rows], derivatives, step, told, variance)

    def __call__(self, points: Array) -> Array:
        """Return the log density at `points` (n, d), shape (n,); -inf outside of the bounds."""
        density = np.full(len(points), -np.inf)
        inside = np.flatnonzero(np.all(np.abs(self.fit.space.project(points) - points) < 1e-12, axis=1))
        if inside.size:
            density[inside] = self._inside(points[inside])
        return density

    def _inside(self, points: Array) -> Array:
        rows = self.fit.recorded_rows
        residuals = self.fit.target[:rows] - self.correction - self.fit.outputs(points)[:, :rows]
        steps = residuals @ self.step.T
        left = residuals - steps @ self.derivatives
        told = np.einsum("ni,ij,nj->n", steps, self.information, steps)
        beyond = np.einsum("ni,ni->n", left, left) / (CORRELATED_ROWS * self.variance)
        prior = np.sum((RANGE * points[:, len(self.fit.space.columns) :]) ** 2, axis=1)
        return np.asarray(-(told + beyond + prior) / 2)


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


def library() -> Any:
    """Return the module `emcee`, which need not be installed."""
    try:
        import emcee
    except ModuleNotFoundError as error:
        if error.name != "emcee":  # it is there, but something that it needs is not
            raise
        raise MethodError(
            "a posterior needs the library 'emcee'; install it with: pip install 'emaphm[posterior]'"
        ) from None
    return emcee


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
    moves = [(emcee.moves.DEMove(), 1 - STRETCHES), (emcee.moves.StretchMove(), STRETCHES)]
    sampler = emcee.EnsembleSampler(walkers, point.size, density, moves=moves, vectorize=True)
    random = np.random.RandomState(int(rng.integers(2**32))).get_state()  # noqa: NPY002 - what emcee takes
    state = emcee.State(_started(fit.space, point, covariance, walkers, rng), random_state=random)
    steps, wanted, told = 0, FIRST_CHECK, 0.0
    while True:
        while steps < wanted:
            state = sampler.run_mcmc(state, PACE, skip_initial_state_check=True)
            steps += PACE
            if on_progress:
                told = max(told, steps / max(wanted, USUAL_STEPS))
                on_progress(told)
        chain = sampler.get_chain(discard=int(BURN_IN * steps))
        convergence = Convergence.of(chain, float(np.mean(sampler.acceptance_fraction)), steps)
        if convergence.converged or steps >= MOST_STEPS:
            break
        wanted = _wanted(convergence)
    if on_progress:
        on_progress(1.0)
    return Posterior.of(fit.space, chain.reshape(-1, point.size), convergence)


def _started(space: FaultSpace, point: Array, covariance: Array, walkers: int, rng: np.random.Generator) -> Array:
    """Return where the walkers start, (walkers, d): normal about `point` (d,), reflected at the bounds.

    Those put onto a bound would share it, and no move between them leave it.
    """
    points = rng.multivariate_normal(point, covariance, walkers, method="eigh")
    points = space.lower + np.abs(points - space.lower)
    points = space.upper - np.abs(space.upper - points)
    return space.project(points)


def _wanted(convergence: Convergence) -> int:
    """Return the steps after which to look at convergence again: when there may be enough, soon if unclear."""
    steps = convergence.steps
    longest = float(np.max(convergence.autocorrelation_time))
    enough = 1.1 * ENOUGH * longest / (1 - BURN_IN) if np.isfinite(longest) else 2 * steps
    return int(min(np.clip(enough, 1.2 * steps, 2 * steps), MOST_STEPS))
