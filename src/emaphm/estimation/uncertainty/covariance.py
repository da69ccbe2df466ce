"""The covariance of a least-squares estimate whose residuals are correlated: the sandwich estimator.

Residuals of a good fit are correlated over milliseconds, and larger at some times than at others: ripple,
friction, what the model lacks. The inverse of Fisher's information is then too small. The sandwich
I⁻¹ S I⁻¹ is not: S is the long-run covariance of the scores (derivatives times residual). A weak prior
keeps parameters that the data do not constrain at their prior width.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.uncertainty.fisher_information import information_lower_bound
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance

LEAST_SCORE_VARIANCE = 1e-3
"""Least covariance of the scores, relative to that of white residuals: no fit is that much better."""

LEAST_INFORMATION = 1e-12
"""Information along an axis, relative to the largest, that is no more than rounding."""


@dataclass(frozen=True, eq=False)
class ScoreStatistics:
    """What one set of residuals says of d parameters, without any prior.

    `information`, (d, d), is Fisher's of white residuals; `score_covariance`, (d, d), the long-run covariance
    of the scores. Those of independent sets add up.
    """

    information: Array
    score_covariance: Array

    def covariance(self, prior_deviation: Array, prior_rows: Array | float = 1.0) -> Array:
        """Return the sandwich covariance (d, d) under a prior of standard deviations (d,).

        Of a fit in which `prior_rows`, (d,) or of all alike, count as one observation against the prior.
        """
        # In units of the priors: what is known the least has eigenvalues of 1 there.
        units = np.where(np.isfinite(prior_deviation), prior_deviation, 1.0)
        prior = (units / prior_deviation) ** 2
        total = self._sandwich_information(units) + np.diag(prior)
        values, axes = np.linalg.eigh(total)
        values = np.maximum(values, max(float(prior.min()), float(np.finfo(float).eps * values[-1])))
        optimal = np.asarray(np.outer(units, units) * ((axes / values) @ axes.T), float)
        result = optimal + self._drawn_too_far(optimal, prior_deviation, prior_rows)
        return np.asarray((result + result.T) / 2)

    def answered_by(self, cross: Array, prior: Array) -> "ScoreStatistics":
        """Return the statistics of a fit by derivatives J, where the recording answers by others, R.

        An estimate at which J r = 0 errs by (J Rᵀ + P)⁻¹ times the scores, an estimate by instrumental
        variables, in place of (J Jᵀ + P)⁻¹. `cross` is J Rᵀ over the residual's variance, (d, d), and `prior`
        the fit's own information of the priors P, (d,), in the same unit.
        """
        own = np.diag(prior)
        turned = (self.information + own) @ np.linalg.inv(cross + own)
        return replace(self, score_covariance=turned @ self.score_covariance @ turned.T)

    def _sandwich_information(self, units: Array) -> Array:
        """Return the information (d, d) that the sandwich amounts to, in `units` (d,); 0 where there is none.

        I S⁻¹ I, on the axes of the information alone, with S relative to the information along them: of
        coordinates that act alike S is all but singular, and its inverse would be rounding.
        """
        scale = np.outer(units, units)
        values, axes = np.linalg.eigh(scale * self.information)
        has_some = values > LEAST_INFORMATION * values[-1]
        roots = axes[:, has_some] * np.sqrt(values[has_some])
        if not has_some.any():
            return np.zeros_like(scale)
        whitened = roots / values[has_some]
        ratios, along = np.linalg.eigh(whitened.T @ (scale * self.score_covariance) @ whitened)
        weights = along / np.sqrt(np.maximum(ratios, LEAST_SCORE_VARIANCE))
        root = roots @ weights
        return np.asarray(root @ root.T)

    def _drawn_too_far(self, optimal: Array, prior_deviation: Array, prior_rows: Array | float) -> Array:
        """Return what a fit that is drawn too far to the prior's mean adds (d, d) to an `optimal` covariance.

        A fit weighs all residuals alike: of what the parameters are off that mean, it leaves out the share
        B = (I + n P⁻¹)⁻¹ n P⁻¹, where B* = C P⁻¹ would do. Along axes on which the difference is positive, in
        units of the prior, that is an error (B - B*) P (B - B*)ᵀ.
        """
        rows = np.broadcast_to(prior_rows, prior_deviation.shape)
        drawn = np.linalg.inv(self.information + np.diag(rows / prior_deviation**2))
        drawn *= np.sqrt(np.outer(rows, rows))
        known = np.flatnonzero(np.isfinite(prior_deviation))
        units = np.outer(prior_deviation[known], prior_deviation[known])
        shares, axes = np.linalg.eigh((drawn - optimal)[np.ix_(known, known)] / units)
        added = np.zeros_like(optimal)
        added[np.ix_(known, known)] = (axes * np.maximum(shares, 0.0) ** 2) @ axes.T * units
        return added


@dataclass(frozen=True, eq=False)
class SandwichCovariance:
    """Fisher's `information` (d, d) of white residuals, and the `covariance` (d, d) of correlated ones.

    The prior is part of the covariance only. With a response R, the information is J Rᵀ over the variance.
    """

    information: Array
    covariance: Array


def sandwich_covariance(
    jacobians: Array,
    residual: Array,
    prior_deviation: Array,
    channels: int = 1,
    error_scores: Array | float = 0.0,
    prior_rows: float = 1.0,
    response: Array | None = None,
) -> SandwichCovariance:
    """Return the covariance of a least-squares estimate.

    Parameters
    ----------
    jacobians
        Of the model's outputs, shape (n, d, rows): n replicates, each about a slightly other point.
    residual
        Measured less model, shape (rows,).
    prior_deviation
        Standard deviation of each parameter before the data, shape (d,).
    channels
        Series of equal length that stand end to end in the rows.
    error_scores
        Covariance (d, d) of Jacobian times a model error that the residual need not show, as a fit absorbs
        what looks like a parameter.
    prior_rows
        How many rows count as one observation against the prior, in the fit.
    response
        Derivatives of what is recorded, shape (d, rows), where they are not those of the fitted model.
    """
    statistics = score_statistics(jacobians, residual, channels, error_scores)
    information = statistics.information
    if response is not None:
        variance = _variance(jacobians, residual)
        information = jacobians.mean(axis=0) @ response.T / variance
        statistics = statistics.answered_by(information, prior_rows / prior_deviation**2)
    return SandwichCovariance(information, statistics.covariance(prior_deviation, prior_rows))


def score_statistics(
    jacobians: Array, residual: Array, channels: int, error_scores: Array | float
) -> ScoreStatistics:
    """Return what residuals say of the parameters; parameters as in `sandwich_covariance`."""
    variance = _variance(jacobians, residual)
    by_channel = np.split(jacobians, channels, axis=2)
    fisher = np.sum([information_lower_bound(part) for part in by_channel], axis=0) / variance
    # An estimate follows the mean of the Jacobians; the errors of single ones are not its own.
    scores = jacobians.mean(axis=0) * residual
    scatter = long_run_covariance(scores, channels) + error_scores
    score_covariance = scatter / variance**2 + LEAST_SCORE_VARIANCE * fisher
    return ScoreStatistics(fisher, score_covariance)


def _variance(jacobians: Array, residual: Array) -> float:
    """Return the variance of a `residual` (rows,) that information is relative to."""
    # A perfect fit would make the information infinite: rounding leaves at least this residual.
    rounding = 1e-20 * float(np.mean(jacobians**2)) + np.finfo(float).tiny ** 0.25
    return float(max(float(np.mean(residual**2)), rounding))
