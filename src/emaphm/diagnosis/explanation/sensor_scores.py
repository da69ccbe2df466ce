"""Score tests for sensor errors that are not estimated, from the residual of the estimate.

A current that is a millisecond late appears as a lower position gain, with a small residual. This residual
has the direction of the signal's derivative. For each possible error of a sensor, its size is estimated from
the residual as one more parameter of the linear model at the estimate, in addition to all estimated
parameters (score test: Rao 1948; partial regression: Frisch and Waugh 1933).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array, rms
from emaphm.diagnosis.explanation.refits import mean_square_after_descents
from emaphm.estimation.levenberg_marquardt import movable
from emaphm.estimation.search_result import SMALLEST_SHARE, SearchResult
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.estimation.uncertainty.local_covariance import (
    moves_slowly,
    reference_response,
    rounding_scores,
)
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance
from emaphm.estimation.uncertainty.partial_regression import answered_sizes
from emaphm.estimation.uncertainty.switching_scores import switching_errors
from emaphm.random_streams import stream
from emaphm.recording.noise import rounding_step


@dataclass(frozen=True)
class SensorScoreSettings:
    """Limits from which a sensor error contradicts an estimate; `make study` (spoilt) measures the effect.

    An error is tried if it is `score` standard errors from 0 and larger than is usual for any rig: `delay`
    [s], `scale` (relative), `offset` (relative to the channel's rms). At most `most` errors are tried, the
    most significant first. The standard error includes that of the model: `alignment` is the share of the
    model's error that may lie along a direction. An error contradicts the estimate if less than `share` of
    the mean squared residual remains after `descents` with it. Correct recordings had 0.99 and more, one row
    of delay at 5 kHz 0.77 to 0.99.
    """

    score: float = 2.0
    delay: float = 2e-5
    scale: float = 0.02
    offset: float = 0.02
    most: int = 3
    alignment: float = 0.25
    descents: int = 2
    share: float = 0.985


SENSOR_SCORES = SensorScoreSettings()


@dataclass(frozen=True)
class SensorScore:
    """Estimated `size` of a sensor error, with its `standard_error`.

    `kind` is "delay" [s], "scale" (relative) or "offset" (relative to the channel's rms); `channel` is empty
    for an error that all channels share. `rounding` is the size of half a rounding step of the channel.
    """

    kind: str
    channel: str
    size: float
    standard_error: float
    rounding: float = 0.0

    @property
    def score(self) -> float:
        """Absolute size in standard errors."""
        return abs(self.size) / self.standard_error if self.standard_error > 0 else 0.0

    def is_suspect(self) -> bool:
        """Return whether the error is significant, and larger than is usual for any rig."""
        least = max(float(getattr(SENSOR_SCORES, self.kind)), self.rounding)
        return self.score > SENSOR_SCORES.score and abs(self.size) > least

    def __str__(self) -> str:
        """Return a sentence on the error."""
        subject = self.channel or "the recording"
        consequence = "which gives a smaller residual; otherwise the faults would compensate for it"
        if self.kind == "delay":
            way = "late" if self.size > 0 else "early"
            remedy = f"; if this persists, state delay_s = {self.size:.2g} for it under [channels]"
            sentence = f"{subject} seems to be some {1e3 * abs(self.size):.2g} ms {way}, {consequence}"
            return sentence + (remedy if self.channel else "")
        if self.kind == "scale":
            return f"{subject} seems to have another scale, by some {100 * self.size:+.2g} %, {consequence}"
        size = f"{100 * self.size:+.2g} % of its rms"
        return f"{subject} seems to have another zero, by some {size}, {consequence}"


def contradictions(result: SearchResult, jacobians: Array, seed: int) -> list[str]:
    """Return a sentence on the sensor error that contradicts the estimate most, if there is one."""
    scores = sorted(sensor_scores(result, jacobians), key=lambda suspect: -suspect.score)
    suspects = [suspect for suspect in scores if suspect.is_suspect()][: SENSOR_SCORES.most]
    if suspects and moves_slowly(result.objective.problem):
        by_reference = answered_by_reference(result, jacobians, suspects, seed)
        suspects = [suspect for suspect in by_reference if suspect.is_suspect()]
    shares = [_residual_share(result, suspect, seed) for suspect in suspects]
    if not shares or min(shares) >= SENSOR_SCORES.share:
        return []
    return [str(suspects[int(np.argmin(shares))])]


def answered_by_reference(
    result: SearchResult, jacobians: Array, suspects: Sequence[SensorScore], seed: int
) -> list[SensorScore]:
    """Return `suspects` with sizes by the reference model's derivatives.

    In a slow motion the estimate has errors that the regression on the fitted model's derivatives does not
    remove, and these appear as a delay (`answered_sizes`). Standard errors are at least those by the fitted
    model.
    """
    response = reference_response(result, stream(seed, "response of the sensors' errors"))
    errors = switching_errors(result, stream(seed, "switching of the sensors' errors"))
    if response is None:
        return list(suspects)
    mean, directions = jacobians.mean(axis=0), {kind: values for kind, values, _ in _directions(result)}
    scores = []
    for suspect in suspects:
        direction = directions[suspect.kind, suspect.channel][np.newaxis]
        sizes, covariance = answered_sizes(result, (mean, direction), (response, direction), errors)
        error = max(float(covariance[0, 0] ** 0.5), suspect.standard_error)
        scores.append(replace(suspect, size=float(sizes[0]), standard_error=error))
    return scores


def _residual_share(result: SearchResult, error: SensorScore, seed: int) -> float:
    """Return the mean squared residual after descents with a sensor error, relative to that without."""
    objective, rows = result.objective, result.objective.channel_rows
    with_error = result.outputs_correction.copy()
    kinds, directions, _ = zip(*_directions(result), strict=True)
    with_error[:rows] += error.size * directions[kinds.index((error.kind, error.channel))]
    variances = [
        mean_square_after_descents(
            result,
            objective,
            correction,
            SENSOR_SCORES.descents,
            stream(seed, "descents with a sensor's error"),
        )
        for correction in (result.outputs_correction, with_error)
    ]
    return variances[1] / variances[0] if variances[0] > 0 else 1.0


def shift_by_delay(result: SearchResult, jacobians: Array, delay: float) -> Array:
    """Return the error (d,) of the parameters due to a common `delay` [s] of all measured channels."""
    fit = _LinearFit.at(result, jacobians)
    kind = ("delay", "" if len(result.objective.problem.channels) > 1 else result.objective.problem.primary)
    direction = next(values for key, values, _ in _directions(result) if key == kind)
    shift = delay * direction
    return np.asarray(np.linalg.solve(fit.normal, fit.jacobian @ shift))


def sensor_scores(result: SearchResult, jacobians: Array) -> tuple[SensorScore, ...]:
    """Return the scores of delay, scale and offset of each sensor from the residual of `result`.

    With the mean Jacobian J, the residual r and the direction v of an error, the estimate of the error in
    addition to the parameters x, whose prior precision is P, is

        θ = (v·r - b·g) / (v·v - b·J v),   b = (J Jᵀ + P)⁻¹ J v,   g = J r - P x

    Its variance is the long-run variance of the scores (v - bJ) r, plus that due to rounding, over the square
    of the denominator. Parameters that would move beyond a bound are omitted from J.

    Parameters
    ----------
    jacobians
        Jacobians of the channels at the estimate, (n, d, channel rows).
    """
    objective = result.objective
    residual = result.residual[: objective.channel_rows]
    fit = _LinearFit.at(result, jacobians)
    jacobian = fit.jacobian
    kinds, directions, roundings = zip(*_directions(result), strict=True)
    error_directions = np.array(directions)
    effects, products = error_directions @ jacobian.T, error_directions @ residual
    squares = np.einsum("mr,mr->m", error_directions, error_directions)
    coefficients = np.array(
        [
            fit.regression_coefficients(*products_of_error)
            for products_of_error in zip(effects, products, squares, strict=True)
        ]
    )
    curvature = squares - np.einsum("md,md->m", coefficients, effects)
    sizes = products - coefficients @ fit.gradient
    channels = len(objective.problem.channels)
    remaining = error_directions - coefficients @ jacobian
    of_model = _model_error(result, remaining)
    scatter = long_run_covariance(remaining * residual, channels)
    errors = np.sqrt(np.diag(scatter + rounding_scores(objective.problem, remaining)) + of_model**2)
    return tuple(
        SensorScore(kind, channel, float(size / scale), float(error / scale), rounding)
        for (kind, channel), size, error, scale, rounding in zip(
            kinds, sizes, errors, curvature, roundings, strict=True
        )
        if scale > 0
    )


def _model_error(result: SearchResult, directions: Array) -> Array:
    """Return the possible contribution (m,) of the model's error along `directions` (m, rows).

    The model's error is a share of a channel's rms, limited by its residual, and of unknown shape: a part of
    it may lie along a direction.
    """
    objective = result.objective
    rows, channels = objective.channel_rows, len(objective.problem.channels)
    signal, residual = (
        np.sqrt(np.sum(values[:rows].reshape(channels, -1) ** 2, axis=1))
        for values in (objective.target, result.residual)
    )
    error = SENSOR_SCORES.alignment * np.minimum(SMALLEST_SHARE * signal, residual)
    lengths = np.sqrt(np.sum(directions.reshape(len(directions), channels, -1) ** 2, axis=2))
    return np.asarray(np.sqrt(np.sum((error * lengths) ** 2, axis=1)))


@dataclass(frozen=True, eq=False)
class _LinearFit:
    """The linear model at `point` (d,): Jacobian (d, rows), normal matrix (d, d) and gradient (d,)."""

    space: ParameterSpace
    point: Array
    jacobian: Array
    normal: Array
    gradient: Array

    @classmethod
    def at(cls, result: SearchResult, jacobians: Array) -> "_LinearFit":
        """Return the linear model at the estimate of `result`, from `jacobians` (n, d, channel rows)."""
        space = result.objective.space
        residual = result.residual[: result.objective.channel_rows]
        rows = result.objective.rows_of_priors
        prior = float(np.mean(residual**2)) * rows / space.prior_deviations**2
        # The prior of a fault component limits its error, but does not pull it to the centre.
        centred = np.where(np.arange(prior.size) < len(space.columns), 0.0, prior * result.point)
        jacobian = jacobians.mean(axis=0)
        normal = jacobian @ jacobian.T + np.diag(prior)
        return cls(space, result.point, jacobian, normal, jacobian @ residual - centred)

    def regression_coefficients(self, effect: Array, product: float, square: float) -> Array:
        """Return the regression coefficients (d,) of a direction on the Jacobian; 0 at active bounds.

        `effect` (d,), `product` and `square` are the products of the direction with the Jacobian, with the
        residual and with itself.
        """
        free = movable(self.point, self.gradient, self.space)
        share = np.zeros(self.point.size)
        while free.size:
            normal = self.normal[np.ix_(free, free)]
            share[:] = 0.0
            share[free], step = np.linalg.solve(normal, np.array([effect[free], self.gradient[free]]).T).T
            curvature = square - float(share @ effect)
            size = (product - float(share @ self.gradient)) / curvature if curvature > 0 else 0.0
            end = self.point[free] + step - size * share[free]
            inside = (end >= self.space.lower[free]) & (end <= self.space.upper[free])
            if inside.all():
                break
            free = free[inside]
            share[:] = 0.0
        return share


def _directions(result: SearchResult) -> Iterator[tuple[tuple[str, str], Array, float]]:
    """Yield kind and channel of each error, its effect (rows,) on the weighted channels, and its rounding.

    The last value is the size of half a rounding step of the channel.
    """
    objective = result.objective
    problem = objective.problem
    channels = len(problem.channels)
    modelled = (result.outputs + result.outputs_correction)[: objective.channel_rows].reshape(channels, -1)
    later = -np.asarray(np.gradient(modelled, problem.inputs.interval, axis=1))
    if channels > 1:
        yield ("delay", ""), later.ravel(), 0.0
    for i, name in enumerate(problem.channels):
        half_step = problem.weights[i] * rounding_step(problem.measured[name]) / 2
        for kind, values in (
            ("delay", later[i]),
            ("scale", modelled[i]),
            ("offset", np.full(problem.samples, rms(modelled[i]))),
        ):
            alone, size = np.zeros_like(modelled), rms(values)
            alone[i] = values
            yield (kind, name), alone.ravel(), half_step / size if size > 0 else 0.0
