"""Score tests for hidden laws, for which faults compensate so that the residual is expected without them.

A torque constant that falls with the current appears as small shorts, an eccentricity, a friction below
healthy or another inertia; a voltage drop of the inverter as another inertia or scale; a lag of the speed
feedback as backlash; friction that depends on the load as constant friction; cogging as an eccentricity. The
remaining residual is no larger than noise and switching, but it has the direction of the law (score test, Rao
1948). If the score is significant, the whole search is repeated with the law.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.laws import LAWS, typical_dry_friction, typical_speed
from emaphm.actuator.unit.baseline import SIGNED
from emaphm.arrays import Array
from emaphm.diagnosis.selection.laws.law_fit import with_free_law
from emaphm.estimation.discrepancy import has_reference
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.parameter_variation import varied
from emaphm.estimation.uncertainty.local_covariance import (
    RESPONSE_REPLICATES,
    RESPONSE_STEP,
    by_reference,
    jacobians_of,
    moves_slowly,
    reference_response,
)
from emaphm.estimation.uncertainty.partial_regression import answered_sizes, regressed
from emaphm.estimation.uncertainty.switching_scores import switching_errors
from emaphm.quantiles import chi_squared_quantile
from emaphm.random_streams import stream


@dataclass(frozen=True)
class HiddenLaw:
    """A hidden law, and the limit from which it is suspected.

    `scale` returns the unit of the law's parameters for an actuator, one for all or one for each. A law with
    a size below `least`, in this unit, has no relevant effect.
    """

    name: str
    scale: Callable[[Actuator], Array | float]
    least: float


def _per_current_limit(actuator: Actuator) -> float:
    return 1 / actuator.controller.current_limit


def _of_supply(actuator: Actuator) -> float:
    return actuator.electrical.supply if actuator.electrical else 1.0


def _of_commutation(actuator: Actuator) -> Array:
    return np.array([1.0, 1 / (actuator.pole_pairs * typical_speed(actuator))])


def _of_speed_gain(actuator: Actuator) -> float:
    return actuator.controller.speed_gain


def _unity(actuator: Actuator) -> float:  # noqa: ARG001
    return 1.0


HIDDEN = (
    HiddenLaw("saturation", _per_current_limit, 0.02),
    HiddenLaw("inverter-drop", _of_supply, 0.002),
    HiddenLaw("emf-flats", _unity, 0.05),
    HiddenLaw("emf-sine", _unity, 0.03),
    HiddenLaw("hall-angles", _unity, 0.015),
    HiddenLaw("commutation-lag", _of_commutation, 0.006),
    HiddenLaw("speed-lag", _unity, 5e-5),
    HiddenLaw("speed-integral", _of_speed_gain, 5.0),
    HiddenLaw("position-integral", _unity, 1.0),
    HiddenLaw("feedforward", _unity, 0.01),
    HiddenLaw("command-lag", _unity, 5e-5),
    HiddenLaw("load-dependent", _unity, 0.004),
    HiddenLaw("cogging", typical_dry_friction, 0.02),
)
"""Hidden laws. Units of the sizes, in this order: shares of the torque constant at the current limit and of
the supply, radians, share of the back-EMF, radians, radians at a typical speed, seconds, 1/s for both
integral parts, share of the command's rate, seconds, shares of the transmitted torque and of dry friction."""

ENDS = {True: (-0.1, 0.1), False: (-3.0, 0.0)}
"""Coordinates between which a derivative is taken. Parameter of either sign: a tenth of its size on both
sides of 0. Positive parameter: from a twentieth of a usual value to that value."""

WIDER = 5.0
"""Factor on the distance of these coordinates, for a parameter of either sign and the reference model: the
effect of a tenth of its size is less than the ripple, which differs between runs."""


@dataclass(frozen=True)
class HiddenLawSettings:
    """Limits of the score test from which a law is suspected.

    The score is above `score` standard errors, and the standard error below `informative` times the smallest
    relevant size. A law with a score above `certain` is kept if the residual is smaller at all. In 74
    recordings without any of the laws, with random faults and loads, the largest sizes were 0.017, 0.0011,
    1e-5 (in 30 others), 0.0018 and 0.011, in the order of `HIDDEN` without back-EMF, commutation and control.
    For the laws of the back-EMF, 160 such recordings had at most 0.012 and 0.030, and 3.2 standard errors.
    For commutation, 60 and 45 had at most 0.006 and 0.011 where the score was above 2; for control, 44 had at
    most 4, 0.6, 0.001 and 2e-5 there. Plants with the laws had 0.1 to 0.26, 0.006 to 0.02, 2e-4 to 3e-4, 0.02
    to 0.05 and 0.07, and faults that compensated for them.
    """

    score: float = 2.0
    certain: float = 5.0
    informative: float = 2.5


HIDDEN_LAWS = HiddenLawSettings()


@dataclass(frozen=True, eq=False)
class Score:
    """Estimates (p,) of a law's parameters by the linear model, in their scale, and covariance (p, p)."""

    values: Array
    covariance: Array

    @property
    def size(self) -> float:
        """Euclidean norm of the estimates."""
        return float(np.linalg.norm(self.values))

    @property
    def error(self) -> float:
        """Largest standard error of the estimates."""
        return float(np.diag(self.covariance).max() ** 0.5)

    def is_beyond(self, deviations: float) -> bool:
        """Return whether Wald's statistic is as significant as a normal variable beyond `deviations`.

        Without the law it has a chi-squared distribution with p degrees of freedom.
        """
        wald = float(self.values @ np.linalg.solve(self.covariance, self.values))
        return wald > chi_squared_quantile(self.values.size, math.erf(deviations / math.sqrt(2)))


def suspected_laws(result: SearchResult, seed: int) -> dict[str, Score]:
    """Return the scores of the hidden laws that are significant at an estimate without them.

    The scores are computed by the derivatives of the fitted model. Significant laws must also be significant
    by the reference model's derivatives by the law, and then by all derivatives of the reference model. In
    slow motions the derivatives of the two models differ by factors, and an error of the estimate appears as
    a law: the test by the law's derivatives alone is omitted there.

    No law is suspected of a unit whose model error was learned: its residuals may have the direction of a
    law.
    """
    scores = hidden_scores(result, seed)
    determined = [law for law in HIDDEN if law.name in scores and _is_determined(law, scores[law.name])]
    suspected = _suspected(determined, scores)
    if suspected and has_reference(result.objective.problem):
        answers = Answers.of(result, suspected, seed)
        if not moves_slowly(result.objective.problem):
            suspected = _suspected(suspected, answers.scores(answers.jacobian))
        if suspected:
            response = reference_response(result, stream(seed, "Jacobians of the response"))
            assert response is not None  # noqa: S101 - computed only where there is a reference model
            scores = answers.scores(response)
            suspected = _suspected(suspected, scores)
    return {law.name: scores[law.name] for law in suspected}


def _suspected(laws: Sequence[HiddenLaw], scores: Mapping[str, Score]) -> list[HiddenLaw]:
    """Return which of `laws` are suspected by their `scores`; a law without a score is not."""
    return [law for law in laws if law.name in scores and _is_suspected(law, scores[law.name])]


def _is_determined(law: HiddenLaw, score: Score) -> bool:
    """Return whether the data determine the size of a law well enough."""
    return score.error <= HIDDEN_LAWS.informative * law.least


def _is_suspected(law: HiddenLaw, score: Score) -> bool:
    """Return whether the estimate of a law is possible, relevant and significant."""
    signed = LAWS[law.name].parameters[0] in SIGNED
    if not (signed or score.values.min() > 0):
        return False
    return score.size > law.least and score.is_beyond(HIDDEN_LAWS.score)


def hidden_scores(result: SearchResult, seed: int) -> dict[str, Score]:
    """Return the scores of the hidden laws that the actuator may have, each for this law alone.

    The derivatives are those of one model with all laws at values of nearly no effect.
    """
    objective, problem = result.objective, result.objective.problem
    laws = [law for law in HIDDEN if LAWS[law.name].is_possible(problem.actuator)]
    if not laws or any(problem.actuator.model_error.of(name) for name in problem.channels):
        return {}
    by_law = _derivatives(result, laws)
    jacobians = jacobians_of(result, stream(seed, "Jacobians of the hidden laws"))
    mean, residual = jacobians.mean(axis=0), result.residual[: objective.channel_rows]
    scores = {}
    for name, derivatives in by_law.items():
        _, values, covariance = regressed(mean, derivatives, residual, problem)
        scores[name] = Score(values, covariance)
    return scores


@dataclass(frozen=True, eq=False)
class Answers:
    """Derivatives of both models by suspected laws at `result`, for `answered_sizes`.

    `jacobian` (d, channel rows) is the fitted model's by the estimated coordinates; `fitted` and `answered`
    are the derivatives (p, channel rows) of the fitted and of the reference model by each law. `errors` are
    those of the switching, from `switching_errors`.
    """

    result: SearchResult
    jacobian: Array
    fitted: dict[str, Array]
    answered: dict[str, Array]
    errors: Array | None

    @classmethod
    def of(cls, result: SearchResult, laws: Sequence[HiddenLaw], seed: int) -> Self:
        """Return the derivatives by `laws`; each of their parameters takes 32 runs of the reference model."""
        scatter = stream(seed, "responses to the hidden laws").normal(
            0.0, RESPONSE_STEP, (RESPONSE_REPLICATES, result.point.size)
        )
        jacobians = jacobians_of(result, stream(seed, "Jacobians of the hidden laws"))
        return cls(
            result,
            jacobians.mean(axis=0),
            _derivatives(result, laws),
            _derivatives(result, laws, scatter),
            switching_errors(result, stream(seed, "switching of the hidden laws")),
        )

    def scores(self, response: Array) -> dict[str, Score]:
        """Return the scores of the laws if the recording has the derivatives `response` (d, channel rows).

        A law with a parameter that has no effect on the fitted model has no score. An example is a
        feedforward of a stepped command: only a lag of the command, with which `hidden_scores` derives, gives
        it an effect.
        """
        return {
            name: Score(
                *answered_sizes(
                    self.result, (self.jacobian, fitted), (response, self.answered[name]), self.errors
                )
            )
            for name, fitted in self.fitted.items()
            if np.all(np.any(fitted, axis=1))
        }


def _derivatives(
    result: SearchResult, laws: Sequence[HiddenLaw], scatter: Array | None = None
) -> dict[str, Array]:
    """Return the derivatives (p, channel rows) with respect to the parameters of each law, in their scale.

    They are those of the fitted model at the estimate. With a `scatter` (n, d) about the estimate, they are
    those of the reference model: means over n points, because of its switching.
    """
    extended = result.objective
    for law in laws:
        extended = with_free_law(extended, LAWS[law.name], LAWS[law.name].parameters)
    unit = extended.space.nuisances.unit
    names = unit.parameters[len(result.objective.space.nuisances.unit.parameters) :]
    count = len(names)
    signed = np.array([name in SIGNED for name in names])
    ends = np.array([ENDS[bool(is_signed)] for is_signed in signed])
    ends[signed] *= 1.0 if scatter is None else WIDER
    centres = result.objective.space.project(result.point + (0.0 if scatter is None else scatter))
    points = np.stack(
        [_near_neutral_point(extended, result, centre, signed, ends) for centre in np.atleast_2d(centres)]
    )
    points = np.tile(points[:, np.newaxis, np.newaxis], (1, 2, count, 1))
    columns = np.arange(count)
    points[:, 0, columns, columns - count], points[:, 1, columns, columns - count] = ends.T
    simulated = extended if scatter is None else by_reference(extended)
    rows = [simulated.outputs(sides.reshape(2 * count, -1))[:, : extended.channel_rows] for sides in points]
    low, high = np.mean(rows, axis=0).reshape(2, count, -1)
    actuator, units = extended.problem.actuator, np.diag(unit.axes[-count:, -count:])
    values = [
        varied(actuator, name, centre)
        for name, centre in zip(names, units[:, np.newaxis] * ends, strict=True)
    ]
    derivatives = np.asarray((high - low) / np.diff(values))
    rows_of = {law: [i for i, name in enumerate(names) if name in LAWS[law.name].parameters] for law in laws}
    return {
        law.name: derivatives[rows_of[law]]
        * np.reshape(law.scale(result.objective.problem.actuator), (-1, 1))
        for law in laws
    }


def _near_neutral_point(
    extended: MapObjective, result: SearchResult, point: Array, signed: Array, ends: Array
) -> Array:
    """Return a `point` (d,) of `result` in the space with laws, at values of nearly no effect."""
    neutral = extended.space.carried_over(point, result.objective.space)
    neutral[-len(signed) :] = np.where(signed, 0.0, ends[:, 0])
    return neutral
