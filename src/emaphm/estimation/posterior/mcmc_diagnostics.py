"""Convergence diagnostics of the chains that sample a posterior."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from emaphm.arrays import Array
from emaphm.optional_library import import_library

ENOUGH = 50
"""Length of a chain, in autocorrelation times, from which their estimate is reliable (`emcee`'s advice)."""

MOST_R_HAT = 1.05
"""Largest R-hat of a converged chain; with `ENOUGH` autocorrelation times, 25 per half, 1.02 is expected."""


@dataclass(frozen=True, eq=False)
class McmcDiagnostics:
    """Convergence of the chains, and their effective number of samples.

    `autocorrelation_time` (d,) [steps], `effective_samples` (d,) and `r_hat` (d,) of the split chains of all
    walkers (Gelman et al. 2013) belong to the estimator coordinates; `acceptance` is the share of accepted
    proposals, `steps` the number of steps of each walker, including burn-in.
    """

    autocorrelation_time: Array
    effective_samples: Array
    r_hat: Array
    acceptance: float
    steps: int
    converged: bool

    @classmethod
    def of(cls, chain: Array, acceptance: float, steps: int) -> Self:
        """Return the diagnostics of `chain` (kept steps, walkers, d)."""
        kept, walkers, _ = chain.shape
        times, r_hat = autocorrelation_time(chain), split_r_hat(chain)
        # The autocorrelation time of a walker that never moved is nan; comparisons with nan are false.
        converged = bool(np.all(kept > ENOUGH * times) and np.all(r_hat < MOST_R_HAT))
        return cls(times, kept * walkers / times, r_hat, acceptance, steps, converged)

    def to_dict(self) -> dict[str, Any]:
        """Return the diagnostics in the output of `emaphm diagnose --posterior --json`."""
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
            f"{100 * self.acceptance:.0f} % of proposals accepted): do not use it; record more channels, "
            "or exclude nuisances that are known to be absent"
        )


def _finite(values: Array) -> list[float | None]:
    """Return `values` (n,) for JSON, with None for values that are not finite."""
    return [float(value) if np.isfinite(value) else None for value in values]


def autocorrelation_time(chain: Array) -> Array:
    """Return the integrated autocorrelation time (d,) [steps] of `chain` (steps, walkers, d).

    It is nan if a walker does not move.
    """
    with np.errstate(invalid="ignore"):
        times = library().autocorr.integrated_time(chain, tol=0)
    return np.asarray(times, float)


def split_r_hat(chain: Array) -> Array:
    """Return R-hat (d,) of the halves of each walker's `chain` (steps, walkers, d); infinite if none moves.

    It is the root of total variance / variance within the halves: Gelman et al. (2013), section 11.4.
    """
    half = len(chain) // 2
    halves = np.concatenate([chain[:half], chain[half : 2 * half]], axis=1)
    within = halves.var(axis=0, ddof=1).mean(axis=0)
    between = halves.mean(axis=0).var(axis=0, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(within > 0, (half - 1) / half + between / within, np.inf)
    return np.asarray(np.sqrt(ratio))


def library() -> Any:
    """Return the optional module `emcee`."""
    return import_library("a posterior", "emcee", "posterior")
