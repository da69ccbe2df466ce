"""Whether the chains that sample a posterior have converged."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from emaphm.arrays import Array
from emaphm.optional_library import import_library

ENOUGH = 50
"""Autocorrelation times in a chain from which their own estimate is reliable (`emcee`'s advice)."""

MOST_R_HAT = 1.05
"""A chain of `ENOUGH` autocorrelation times is expected at 1.02: its halves have 25 each."""


@dataclass(frozen=True, eq=False)
class McmcDiagnostics:
    """Whether the chains have converged, and how many samples they are worth.

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
            f"{100 * self.acceptance:.0f} % of proposals accepted): do not use it; record more channels, "
            "or exclude nuisances that are known to be absent"
        )


def _finite(values: Array) -> list[float | None]:
    """Return `values` (n,) as JSON can hold them."""
    return [float(value) if np.isfinite(value) else None for value in values]


def autocorrelation_time(chain: Array) -> Array:
    """Return the integrated autocorrelation time (d,) [steps] of `chain` (steps, walkers, d).

    It is nan where a walker stands still.
    """
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


def library() -> Any:
    """Return the module `emcee`, which need not be installed."""
    return import_library("a posterior", "emcee", "posterior")
