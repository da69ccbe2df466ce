"""Sensors that err although nobody estimates it: score tests on the residual of the faults' estimate.

A current that comes a millisecond late reads as a lower position gain, with a small residual. But that
residual has a direction: that of the signal's derivative. For each error that a sensor may have, its size is
estimated from the residual as if it were one more parameter of the linear model at the estimate, next to all
that is estimated already (Rao 1948: a score test; Frisch and Waugh 1933: the partial regression).
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
    """From when on a sensor's error contradicts an estimate; `make study` (spoilt) measures it.

    Tried is an error that is `score` standard errors from 0 and larger than what every rig may have: `delay`
    [s], `scale` (relative), `offset` (relative to the channel's rms); `most` of them, the most significant
    first. The standard error includes the model's own: `alignment` is the share of it that may lie along a
    direction. It contradicts where `descents` with that error leave less than `share` of the mean squared
    residual. True recordings left 0.99 and more, one row of delay at 5 kHz 0.77 to 0.99.
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
    """The `size` of a sensor's error that the residual shows, and its `standard_error`.

    `kind` is "delay" [s], "scale" (relative) or "offset" (relative to the channel's rms); `channel` is empty
    where all channels have it together. `rounding` is what half a step of the channel's values amounts to.
    """

    kind: str
    channel: str
    size: float
    standard_error: float
    rounding: float = 0.0

    @property
    def score(self) -> float:
        """The size in standard errors, without sign."""
        return abs(self.size) / self.standard_error if self.standard_error > 0 else 0.0

    def is_suspect(self) -> bool:
        """Return whether the error is significant, and larger than every rig may have."""
        least = max(float(getattr(SENSOR_SCORES, self.kind)), self.rounding)
        return self.score > SENSOR_SCORES.score and abs(self.size) > least

    def __str__(self) -> str:
        """Return a sentence."""
        what = self.channel or "what was measured"
        certainty = "which leaves a smaller residual; the faults would otherwise take it up"
        if self.kind == "delay":
            way = "late" if self.size > 0 else "early"
            mend = f"; if it always does, state delay_s = {self.size:.2g} for it under [channels]"
            found = f"{what} seems to come some {1e3 * abs(self.size):.2g} ms {way}, {certainty}"
            return found + (mend if self.channel else "")
        if self.kind == "scale":
            return f"{what} seems to have another scale, by some {100 * self.size:+.2g} %, {certainty}"
        return f"{what} seems to have another zero, by some {100 * self.size:+.2g} % of its rms, {certainty}"


def contradictions(result: SearchResult, jacobians: Array, seed: int) -> list[str]:
    """Return a sentence on the error that contradicts the estimate most, if one does.

    `jacobians` (n, d, channel rows) are those of the channels at the estimate.
    """
    scores = sorted(sensor_scores(result, jacobians), key=lambda one: -one.score)
    suspects = [one for one in scores if one.is_suspect()][: SENSOR_SCORES.most]
    if suspects and moves_slowly(result.objective.problem):
        answered = answered_by_reference(result, jacobians, suspects, seed)
        suspects = [one for one in answered if one.is_suspect()]
    shares = [_residual_share(result, one, seed) for one in suspects]
    if not shares or min(shares) >= SENSOR_SCORES.share:
        return []
    return [str(suspects[int(np.argmin(shares))])]


def answered_by_reference(
    result: SearchResult, jacobians: Array, suspects: Sequence[SensorScore], seed: int
) -> list[SensorScore]:
    """Return `suspects` as they are where the recording answers by the reference model's derivatives.

    On a slow motion the estimate errs along directions that the fitted model's derivatives do not take out,
    and these pass for a delay (`answered_sizes`). No standard error is smaller than by the fitted model.
    """
    response = reference_response(result, stream(seed, "response of the sensors' errors"))
    errors = switching_errors(result, stream(seed, "switching of the sensors' errors"))
    if response is None:
        return list(suspects)
    mean, along = jacobians.mean(axis=0), {kind: values for kind, values, _ in _directions(result)}
    answered = []
    for one in suspects:
        direction = along[one.kind, one.channel][np.newaxis]
        sizes, covariance = answered_sizes(result, (mean, direction), (response, direction), errors)
        error = max(float(covariance[0, 0] ** 0.5), one.standard_error)
        answered.append(replace(one, size=float(sizes[0]), standard_error=error))
    return answered


def _residual_share(result: SearchResult, error: SensorScore, seed: int) -> float:
    """Return what descents with a sensor's error leave of the mean squared residual, relative to without."""
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


def taken_up_of_a_delay(result: SearchResult, jacobians: Array, delay: float) -> Array:
    """Return by how much the parameters (d,) are off where all that was measured came a `delay` [s] late."""
    fit = _LinearFit.at(result, jacobians)
    kind = ("delay", "" if len(result.objective.problem.channels) > 1 else result.objective.problem.primary)
    direction = next(values for which, values, _ in _directions(result) if which == kind)
    shift = delay * direction
    return np.asarray(np.linalg.solve(fit.normal, fit.jacobian @ shift))


def sensor_scores(result: SearchResult, jacobians: Array) -> tuple[SensorScore, ...]:
    """Return what the residual of `result` shows of each sensor's delay, scale and offset.

    With the rows J of the mean Jacobian, the residual r and the direction v of an error, the estimate next to
    the parameters x, whose priors are P, is

        θ = (v·r - b·g) / (v·v - b·J v),   b = (J Jᵀ + P)⁻¹ J v,   g = J r - P x

    and its variance is the long-run variance of the scores (v - bJ) r, and what counts of a converter leave
    open of them, over the square of the denominator.
    Parameters that a bound keeps from moving as θ asks are left out of J.

    Parameters
    ----------
    jacobians
        Of the channels at the estimate, (n, d, channel rows).
    """
    objective = result.objective
    residual = result.residual[: objective.channel_rows]
    fit = _LinearFit.at(result, jacobians)
    jacobian = fit.jacobian
    kinds, directions, roundings = zip(*_directions(result), strict=True)
    along = np.array(directions)
    effects, asked = along @ jacobian.T, along @ residual
    squares = np.einsum("mr,mr->m", along, along)
    taken_up = np.array([fit.taken_up(*one) for one in zip(effects, asked, squares, strict=True)])
    curvature = squares - np.einsum("md,md->m", taken_up, effects)
    sizes = asked - taken_up @ fit.gradient
    channels = len(objective.problem.channels)
    remaining = along - taken_up @ jacobian
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
    """Return what the model's own error may contribute along `directions` (m, rows), (m,).

    It is a share of a channel's rms, but no more than its residual, and of unknown shape: some of it may
    happen to lie along what remains of a direction.
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
        """Return the linear model at the estimate of `result`, by `jacobians` (n, d, channel rows)."""
        space = result.objective.space
        residual = result.residual[: result.objective.channel_rows]
        rows = result.objective.rows_of_priors
        prior = float(np.mean(residual**2)) * rows / space.prior_deviations**2
        # A component may be anywhere; what is known of it beforehand does not draw it anywhere.
        centred = np.where(np.arange(prior.size) < len(space.columns), 0.0, prior * result.point)
        jacobian = jacobians.mean(axis=0)
        normal = jacobian @ jacobian.T + np.diag(prior)
        return cls(space, result.point, jacobian, normal, jacobian @ residual - centred)

    def taken_up(self, effect: Array, asked: float, square: float) -> Array:
        """Return what the parameters take up of a direction, (d,): 0 for those that a bound holds.

        `effect`, (d,), `asked` and `square` are the products of the direction with the Jacobian, with the
        residual and with itself.
        """
        free = movable(self.point, self.gradient, self.space)
        share = np.zeros(self.point.size)
        while free.size:
            normal = self.normal[np.ix_(free, free)]
            share[:] = 0.0
            share[free], step = np.linalg.solve(normal, np.array([effect[free], self.gradient[free]]).T).T
            curvature = square - float(share @ effect)
            size = (asked - float(share @ self.gradient)) / curvature if curvature > 0 else 0.0
            reached = self.point[free] + step - size * share[free]
            inside = (reached >= self.space.lower[free]) & (reached <= self.space.upper[free])
            if inside.all():
                break
            free = free[inside]
            share[:] = 0.0
        return share


def _directions(result: SearchResult) -> Iterator[tuple[tuple[str, str], Array, float]]:
    """Yield kind and channel of each error, what a unit of it adds to the weighted channels, (rows,).

    And what half a step of the channel's rounding amounts to.
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
