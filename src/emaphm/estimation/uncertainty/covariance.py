"""Covariance of a least-squares estimate with correlated residuals: the sandwich estimator.

Residuals of a good fit are correlated over milliseconds, and their variance changes with time, due to ripple,
friction and unmodelled effects. The inverse of Fisher's information is then too small. The sandwich
I⁻¹ S I⁻¹ is consistent: S is the long-run covariance of the scores (derivatives times residual). With a weak
prior, parameters that the data do not constrain keep the width of their prior.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.uncertainty.fisher_information import information_lower_bound
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance

LEAST_SCORE_VARIANCE = 1e-3
"""Lower limit of the covariance of the scores, relative to that of white residuals."""

LEAST_INFORMATION = 1e-12
"""Information along an axis, relative to the largest, up to which it counts as a rounding error."""


@dataclass(frozen=True, eq=False)
class ScoreStatistics:
    """Information and score covariance of one set of residuals for d parameters, without any prior.

    `information`, (d, d), is Fisher's information of white residuals; `score_covariance`, (d, d), is the
    long-run covariance of the scores. Both add up over independent sets of residuals.
    """

    information: Array
    score_covariance: Array

    def covariance(self, prior_deviation: Array, prior_rows: Array | float = 1.0) -> Array:
        """Return the sandwich covariance (d, d) under a prior of standard deviations (d,).

        In the fit, `prior_rows` rows, (d,) or one number for all parameters, count as one observation against
        the prior.
        """
        # In units of the priors, unidentified directions have eigenvalues of 1.
        units = np.where(np.isfinite(prior_deviation), prior_deviation, 1.0)
        prior = (units / prior_deviation) ** 2
        total = self._sandwich_information(units) + np.diag(prior)
        values, axes = np.linalg.eigh(total)
        values = np.maximum(values, max(float(prior.min()), float(np.finfo(float).eps * values[-1])))
        optimal = np.asarray(np.outer(units, units) * ((axes / values) @ axes.T), float)
        result = optimal + self._excess_shrinkage(optimal, prior_deviation, prior_rows)
        return np.asarray((result + result.T) / 2)

    def answered_by(self, cross: Array, prior: Array) -> "ScoreStatistics":
        """Return the statistics of a fit with the model's derivatives J if those of the recording are R.

        An estimate at which J r = 0 has the error (J Rᵀ + P)⁻¹ times the scores, as with instrumental
        variables, instead of (J Jᵀ + P)⁻¹ times the scores. `cross` is J Rᵀ divided by the residual's
        variance, (d, d); `prior` is the information P of the priors in the fit, (d,), in the same unit.
        """
        prior_information = np.diag(prior)
        transform = (self.information + prior_information) @ np.linalg.inv(cross + prior_information)
        return replace(self, score_covariance=transform @ self.score_covariance @ transform.T)

    def _sandwich_information(self, units: Array) -> Array:
        """Return the information of the sandwich estimator, I S⁻¹ I (d, d), in `units` (d,).

        It is computed in the axes with information, with S relative to the information along them, and is 0
        along all others: for collinear coordinates S is almost singular, and its inverse would consist of
        rounding errors.
        """
        scale = np.outer(units, units)
        values, axes = np.linalg.eigh(scale * self.information)
        informative = values > LEAST_INFORMATION * values[-1]
        roots = axes[:, informative] * np.sqrt(values[informative])
        if not informative.any():
            return np.zeros_like(scale)
        whitened = roots / values[informative]
        ratios, directions = np.linalg.eigh(whitened.T @ (scale * self.score_covariance) @ whitened)
        weights = directions / np.sqrt(np.maximum(ratios, LEAST_SCORE_VARIANCE))
        root = roots @ weights
        return np.asarray(root @ root.T)

    def _excess_shrinkage(self, optimal: Array, prior_deviation: Array, prior_rows: Array | float) -> Array:
        """Return the covariance (d, d) of the excessive shrinkage towards the prior's mean.

        A fit weighs all residuals alike: it shrinks the parameters' deviation from that mean by the share
        B = (I + n P⁻¹)⁻¹ n P⁻¹, where the optimum is B* = C P⁻¹ with the `optimal` covariance C (d, d). Along
        the axes, in units of the prior, on which the difference is positive, it causes an error with the
        covariance (B - B*) P (B - B*)ᵀ.
        """
        rows = np.broadcast_to(prior_rows, prior_deviation.shape)
        shrunk = np.linalg.inv(self.information + np.diag(rows / prior_deviation**2))
        shrunk *= np.sqrt(np.outer(rows, rows))
        with_prior = np.flatnonzero(np.isfinite(prior_deviation))
        units = np.outer(prior_deviation[with_prior], prior_deviation[with_prior])
        shares, axes = np.linalg.eigh((shrunk - optimal)[np.ix_(with_prior, with_prior)] / units)
        added = np.zeros_like(optimal)
        added[np.ix_(with_prior, with_prior)] = (axes * np.maximum(shares, 0.0) ** 2) @ axes.T * units
        return added


@dataclass(frozen=True, eq=False)
class SandwichCovariance:
    """Fisher's `information` (d, d) of white residuals, and the `covariance` (d, d) of correlated ones.

    The prior is included only in the covariance. With a response R, the information is J Rᵀ / variance.
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
        Jacobians of the model's outputs, shape (n, d, rows): n replicates, each about a slightly different
        point.
    residual
        Measured minus modelled, shape (rows,).
    prior_deviation
        Prior standard deviation of each parameter, shape (d,).
    channels
        Number of series of equal length that are concatenated in the rows.
    error_scores
        Covariance (d, d) of the Jacobian times a model error that need not appear in the residual, because a
        fit absorbs the part of an error that has the same effect as a parameter.
    prior_rows
        Number of rows that count as one observation against the prior in the fit.
    response
        Derivatives of the recorded channels, shape (d, rows), if they differ from those of the fitted model.
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
    """Return the score statistics of a `residual`; parameters as in `sandwich_covariance`."""
    variance = _variance(jacobians, residual)
    by_channel = np.split(jacobians, channels, axis=2)
    fisher = np.sum([information_lower_bound(part) for part in by_channel], axis=0) / variance
    # An estimate depends on the mean of the Jacobians; errors of single Jacobians do not affect it.
    scores = jacobians.mean(axis=0) * residual
    scatter = long_run_covariance(scores, channels) + error_scores
    score_covariance = scatter / variance**2 + LEAST_SCORE_VARIANCE * fisher
    return ScoreStatistics(fisher, score_covariance)


def _variance(jacobians: Array, residual: Array) -> float:
    """Return the variance of a `residual` (rows,) that the information is divided by."""
    # A residual of 0 would make the information infinite: rounding causes at least this residual.
    rounding = 1e-20 * float(np.mean(jacobians**2)) + np.finfo(float).tiny ** 0.25
    return float(max(float(np.mean(residual**2)), rounding))
