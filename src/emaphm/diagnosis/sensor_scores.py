"""Sensors that err although nobody estimates it: score tests on what the faults leave of the residual.

A current that comes a millisecond late reads as a lower position gain, and leaves little residual. But what
it leaves has a direction: that of the signal's derivative. For each error that a sensor may have, its size is
estimated from the residual as if it were one more parameter of the linear model at the estimate, next to all
that is estimated already (Rao 1948: a score test; Frisch and Waugh 1933: the partial regression).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.objective import CORRELATED_ROWS
from emaphm.estimation.problem import rms
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.fisher_information import information
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance


@dataclass(frozen=True)
class SensorScoreSettings:
    """From when on a sensor's error contradicts an estimate; `docs/spoilt.md` shows the effect.

    It is `score` standard errors from 0, and larger than what every rig may have: `delay` [s], `scale`
    (relative), `offset` (relative to the channel's rms). True recordings had up to 3.5 standard errors with a
    larger size, in one of a hundred; one row of delay at 5 kHz has 2 to 5.
    """

    score: float = 4.0
    delay: float = 2e-5
    scale: float = 0.02
    offset: float = 0.02


SENSOR_SCORES = SensorScoreSettings()


@dataclass(frozen=True)
class SensorScore:
    """The `size` of a sensor's error that the residual shows, and its `standard_error`.

    `kind` is "delay" [s], "scale" (relative) or "offset" (relative to the channel's rms); `channel` is empty
    where all channels have it together.
    """

    kind: str
    channel: str
    size: float
    standard_error: float

    @property
    def score(self) -> float:
        """The size in standard errors, without sign."""
        return abs(self.size) / self.standard_error if self.standard_error > 0 else 0.0

    def contradicts(self, settings: SensorScoreSettings = SENSOR_SCORES) -> bool:
        """Return whether the error is significant, and larger than every rig may have."""
        return self.score > settings.score and abs(self.size) > float(getattr(settings, self.kind))

    def __str__(self) -> str:
        """Return a sentence."""
        what = self.channel or "what was measured"
        certainty = f"by {self.score:.0f} standard errors; the faults would otherwise take it up"
        if self.kind == "delay":
            way = "late" if self.size > 0 else "early"
            return f"{what} seems to come some {1e3 * abs(self.size):.2g} ms {way}, {certainty}"
        if self.kind == "scale":
            return f"{what} seems to have another scale, by some {100 * self.size:+.2g} %, {certainty}"
        return f"{what} seems to have another zero, by some {100 * self.size:+.2g} % of its rms, {certainty}"


def contradictions(result: SearchResult, jacobians: Array) -> list[str]:
    """Return a sentence on each kind of error that contradicts the estimate: the most significant of each."""
    found: dict[str, SensorScore] = {}
    for one in sensor_scores(result, jacobians):
        before = found.get(one.kind)
        if one.contradicts() and (before is None or one.score > before.score):
            found[one.kind] = one
    return [str(one) for one in found.values()]


def sensor_scores(result: SearchResult, jacobians: Array) -> tuple[SensorScore, ...]:
    """Return what the residual of `result` shows of each sensor's delay, scale and offset.

    With the rows J of the mean Jacobian, the residual r and the direction v of an error, the estimate next to
    the parameters, whose priors are P, is

        θ = (v·r - b·g) / (v·v - b·J v),   b = (J Jᵀ + P)⁻¹ J v,   g = J r - P x

    and its variance is the long-run variance of the scores (v - bJ) r, over the square of the denominator.

    Parameters
    ----------
    jacobians
        Of the channels at the estimate, (n, d, channel rows).
    """
    objective, point = result.objective, result.point
    residual = result.residual[: objective.channel_rows]
    jacobian = jacobians.mean(axis=0)
    prior = float(np.mean(residual**2)) * CORRELATED_ROWS / objective.space.prior_deviations**2
    # A component may be anywhere; what is known of it beforehand does not draw it anywhere.
    centred = np.where(np.arange(point.size) < len(objective.space.columns), 0.0, prior * point)
    normal = information(jacobians) + np.diag(prior)
    gradient = jacobian @ residual - centred
    kinds, directions = zip(*_directions(result), strict=True)
    along = np.array(directions)
    taken_up = np.linalg.solve(normal, jacobian @ along.T).T
    free = along - taken_up @ jacobian
    curvature = np.einsum("mr,mr->m", along, along) - np.einsum("md,dm->m", taken_up, jacobian @ along.T)
    channels = len(objective.problem.channels)
    scores = (free * residual).reshape(len(along), channels, -1).sum(axis=1)
    errors = np.sqrt(np.diag(long_run_covariance(scores)))
    sizes = along @ residual - taken_up @ gradient
    return tuple(
        SensorScore(kind, channel, float(size / scale), float(error / scale))
        for (kind, channel), size, error, scale in zip(kinds, sizes, errors, curvature, strict=True)
        if scale > 0
    )


def _directions(result: SearchResult) -> Iterator[tuple[tuple[str, str], Array]]:
    """Yield kind and channel of each error, and what a unit of it adds to the weighted channels, (rows,)."""
    objective = result.objective
    problem = objective.problem
    channels = len(problem.channels)
    modelled = (result.outputs + result.outputs_correction)[: objective.channel_rows].reshape(channels, -1)
    later = -np.asarray(np.gradient(modelled, problem.inputs.interval, axis=1))
    if channels > 1:
        yield ("delay", ""), later.ravel()
    for i, name in enumerate(problem.channels):
        for kind, values in (
            ("delay", later[i]),
            ("scale", modelled[i]),
            ("offset", np.full(problem.samples, rms(modelled[i]))),
        ):
            alone = np.zeros_like(modelled)
            alone[i] = values
            yield (kind, name), alone.ravel()
