"""Laws that hide where the residual without them is expected: a score test finds them.

A torque constant that falls with the current reads as small shorts, an eccentricity, a friction below
healthy or another inertia; voltage that the inverter takes, as another inertia or scale; a speed feedback
that lags, as backlash; friction that the load causes, as friction at any load; cogging, as an eccentricity.
What these leave is no more than noise and switching, but it has a direction of its own (Rao 1948). Where that
shows, the whole search is repeated with the law.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

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
    reference_response,
)
from emaphm.estimation.uncertainty.partial_regression import answered_sizes, regressed
from emaphm.estimation.uncertainty.switching_scores import switching_errors
from emaphm.quantiles import chi_squared_quantile
from emaphm.random_streams import stream


@dataclass(frozen=True)
class HiddenLaw:
    """A law that hides, and when it is suspected.

    Its parameters are relative to what `scale` returns of an actuator, one for all or one for each; a size
    below `least` makes up for nothing that matters.
    """

    name: str
    scale: Callable[[Actuator], Array | float]
    least: float


def _of_current_limit(actuator: Actuator) -> float:
    return 1 / actuator.controller.current_limit


def _of_supply(actuator: Actuator) -> float:
    return actuator.electrical.supply if actuator.electrical else 1.0


def _of_commutation(actuator: Actuator) -> Array:
    poles = actuator.electrical.pole_pairs if actuator.electrical else 1
    return np.array([1.0, 1 / (poles * typical_speed(actuator))])


def _of_speed_gain(actuator: Actuator) -> float:
    return actuator.controller.speed_gain


def _absolute(actuator: Actuator) -> float:  # noqa: ARG001
    return 1.0


HIDDEN = (
    HiddenLaw("saturation", _of_current_limit, 0.02),
    HiddenLaw("inverter-drop", _of_supply, 0.002),
    HiddenLaw("emf-flats", _absolute, 0.05),
    HiddenLaw("emf-sine", _absolute, 0.03),
    HiddenLaw("hall-angles", _absolute, 0.015),
    HiddenLaw("commutation-lag", _of_commutation, 0.006),
    HiddenLaw("speed-lag", _absolute, 5e-5),
    HiddenLaw("speed-integral", _of_speed_gain, 5.0),
    HiddenLaw("position-integral", _absolute, 1.0),
    HiddenLaw("feedforward", _absolute, 0.01),
    HiddenLaw("command-lag", _absolute, 5e-5),
    HiddenLaw("load-dependent", _absolute, 0.004),
    HiddenLaw("cogging", typical_dry_friction, 0.02),
)
"""Sizes are shares of the torque constant at the current limit and of the supply, radians, a share of the
back-EMF, radians, radians at a typical speed, seconds, of the integral parts 1/s, of the feedforward a share,
seconds, and shares of the transmitted torque and of dry friction."""

ENDS = {True: (-0.1, 0.1), False: (-3.0, 0.0)}
"""Between which coordinates a derivative is taken, of a parameter of either sign and of a positive one: a
tenth of its size either way of none; from a twentieth of a usual value to that."""

WIDER = 5.0
"""How many times as far apart the ends of a parameter of either sign are for the reference model: what a
tenth of its size does is less than the ripple, which is another in each run."""


@dataclass(frozen=True)
class HiddenLawSettings:
    """When a law is suspected, by the score test.

    By a score above `score` standard errors, where the data determine it to `informative` times the least
    size that matters; one above `certain` is kept if it leaves less at all. Of 74 recordings without any of
    the laws, with random faults and loads, none had a size of more than 0.017, 0.0011, 1e-5 (of 30 others),
    0.0018 and 0.011, in the order of `HIDDEN` but for back-EMF, commutation and control; of the laws of the
    back-EMF 160 such recordings had 0.012 and 0.030, and 3.2 standard errors at most; of commutation 60 and
    45 had 0.006 and 0.011 where the score was beyond 2; of the control 44 had 4, 0.6, 0.001 and 2e-5 there.
    Other plants had 0.1 to 0.26, 0.006 to 0.02, 2e-4 to 3e-4, 0.02 to 0.05 and 0.07, and faults that made up
    for them.
    """

    score: float = 2.0
    certain: float = 5.0
    informative: float = 2.5


HIDDEN_LAWS = HiddenLawSettings()


@dataclass(frozen=True, eq=False)
class Score:
    """A law's parameters (p,) by the linear model, relative to their scale, and their covariance (p, p)."""

    values: Array
    covariance: Array

    @property
    def size(self) -> float:
        """The root of the sum of their squares."""
        return float(np.linalg.norm(self.values))

    @property
    def error(self) -> float:
        """The largest standard error."""
        return float(np.diag(self.covariance).max() ** 0.5)

    def is_beyond(self, deviations: float) -> bool:
        """Return whether Wald's statistic is rarer by chance than a normal variable beyond `deviations`.

        Without the law it is of chi-squared with p degrees of freedom.
        """
        wald = float(self.values @ np.linalg.solve(self.covariance, self.values))
        return wald > chi_squared_quantile(self.values.size, math.erf(deviations / math.sqrt(2)))


def suspected_laws(result: SearchResult, seed: int) -> dict[str, Score]:
    """Return the scores of the hidden laws that the residual of an estimate without them shows.

    By the derivatives of the fitted model and, of those that it shows, by those of the reference model too:
    on slow motions these differ by factors, and what the estimate is off passes for a law.

    None of a unit whose model error was learned: what is left of its recordings has directions of its own.
    """
    scores = hidden_scores(result, seed)
    shown = [law for law in HIDDEN if law.name in scores and _is_determined(law, scores[law.name])]
    shown = [law for law in shown if _is_suspected(law, scores[law.name])]
    if shown and has_reference(result.objective.problem):
        scores = answered_scores(result, shown, seed)
        shown = [law for law in shown if _is_suspected(law, scores[law.name])]
    return {law.name: scores[law.name] for law in shown}


def _is_determined(law: HiddenLaw, score: Score) -> bool:
    return score.error <= HIDDEN_LAWS.informative * law.least


def _is_suspected(law: HiddenLaw, score: Score) -> bool:
    signed = LAWS[law.name].parameters[0] in SIGNED
    if not (signed or score.values.min() > 0):
        return False
    return score.size > law.least and score.is_beyond(HIDDEN_LAWS.score)


def hidden_scores(result: SearchResult, seed: int) -> dict[str, Score]:
    """Return the scores of the hidden laws that the actuator may have, each as if it alone were there.

    All are taken from one model that has them all, as good as neutral.
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


def answered_scores(result: SearchResult, laws: Sequence[HiddenLaw], seed: int) -> dict[str, Score]:
    """Return the scores of hidden `laws` by what the reference model answers to them (`answered_sizes`)."""
    response = reference_response(result, stream(seed, "Jacobians of the response"))
    assert response is not None  # noqa: S101 - asked for only where there is a reference model
    scatter = stream(seed, "responses to the hidden laws").normal(
        0.0, RESPONSE_STEP, (RESPONSE_REPLICATES, result.point.size)
    )
    fitted, answered = _derivatives(result, laws), _derivatives(result, laws, scatter)
    mean = jacobians_of(result, stream(seed, "Jacobians of the hidden laws")).mean(axis=0)
    errors = switching_errors(result, stream(seed, "switching of the hidden laws"))
    return {
        name: Score(*answered_sizes(result, (mean, fitted[name]), (response, answered[name]), errors))
        for name in fitted
    }


def _derivatives(
    result: SearchResult, laws: Sequence[HiddenLaw], scatter: Array | None = None
) -> dict[str, Array]:
    """Return the derivatives (p, channel rows) by the parameters of each law, relative to their scale.

    At the estimate, by the fitted model; by the reference model where a `scatter` (n, d) about it is given:
    their mean over as many points, which its switching needs.
    """
    extended = result.objective
    for law in laws:
        extended = with_free_law(extended, LAWS[law.name], LAWS[law.name].parameters)
    unit = extended.space.nuisances.unit
    names = unit.parameters[len(result.objective.space.nuisances.unit.parameters) :]
    count = len(names)
    signed = np.array([name in SIGNED for name in names])
    ends = np.array([ENDS[bool(one)] for one in signed])
    ends[signed] *= 1.0 if scatter is None else WIDER
    centres = result.objective.space.project(result.point + (0.0 if scatter is None else scatter))
    points = np.stack([_neutral(extended, result, one, signed, ends) for one in np.atleast_2d(centres)])
    points = np.tile(points[:, np.newaxis, np.newaxis], (1, 2, count, 1))
    columns = np.arange(count)
    points[:, 0, columns, columns - count], points[:, 1, columns, columns - count] = ends.T
    answering = extended if scatter is None else by_reference(extended)
    rows = [answering.outputs(sides.reshape(2 * count, -1))[:, : extended.channel_rows] for sides in points]
    low, high = np.mean(rows, axis=0).reshape(2, count, -1)
    actuator, units = extended.problem.actuator, np.diag(unit.axes[-count:, -count:])
    values = [
        varied(actuator, name, one) for name, one in zip(names, units[:, np.newaxis] * ends, strict=True)
    ]
    derivatives = np.asarray((high - low) / np.diff(values))
    own = {law: [i for i, name in enumerate(names) if name in LAWS[law.name].parameters] for law in laws}
    return {
        law.name: derivatives[own[law]] * np.reshape(law.scale(result.objective.problem.actuator), (-1, 1))
        for law in laws
    }


def _neutral(extended: MapObjective, result: SearchResult, point: Array, signed: Array, ends: Array) -> Array:
    """Return a `point` (d,) of `result` in the space of an objective that has laws too, all but neutral."""
    neutral = extended.space.carried_over(point, result.objective.space)
    neutral[-len(signed) :] = np.where(signed, 0.0, ends[:, 0])
    return neutral
