"""Estimates with an additional law, or with other additional parameters of an objective.

A missing law may have caused a large error of the estimate, or hardly change it. The fit with the law is
therefore searched for globally and from that estimate, and the reference model corrects the best of both.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.actuator import described_parts
from emaphm.actuator.laws import LAWS, Law
from emaphm.arrays import Array
from emaphm.diagnosis.law_parameters import without_effect_at_zero
from emaphm.diagnosis.selection.residual_share import hopelessness_relative_to, is_residual_above
from emaphm.diagnosis.selection.settings import DESCRIPTION_ERRORS, LAW_SELECTION, MOTOR
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.global_search.multistart import local_search, multistart
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.reference.refinement import refine_by_reference
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.estimation.space.parameter_variation import ParameterVariation
from emaphm.estimation.uncertainty.local_covariance import jacobians_at, local_covariance
from emaphm.random_streams import stream

ONLY_WHILE_SWITCHING = ("sensor-lag",)
"""Laws with hardly any effect in the averaged model: they are estimated by a scan of the reference model."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Best fits of the averaged model with the additional parameters of `objective`, called `name`.

    The points (n, d) are the end points of descents from the estimate `before`, with its correction, and of a
    new global search. `near` and `far` are the smallest costs [A²] of the two: `near` is relevant for small
    effects, `far` for effects that caused a large error of the estimate before.
    """

    name: str
    before: SearchResult
    objective: MapObjective
    points: Array
    near: float
    far: float

    @classmethod
    def of(cls, before: SearchResult, objective: MapObjective, name: str, settings: SearchSettings) -> Self:
        """Return the fit of an `objective` with more parameters than that of `before`."""
        global_search = multistart(objective, settings.seed, settings.method.optimizer)
        start = objective.space.carried_over(before.point, before.objective.space)
        correction = objective.of_channels(before.outputs_correction)
        near = local_search(objective, start, correction, stream(settings.seed, "local search")).best
        return cls(
            name,
            before,
            objective,
            np.vstack([near, global_search.points]),
            _current_cost(objective, near, correction),
            min(_current_cost(objective, point, 0.0) for point in global_search.points),
        )

    def corrected(self, settings: SearchSettings) -> SearchResult:
        """Return the estimate corrected by the reference model; the correction stops if it is hopeless."""
        is_hopeless = hopelessness_relative_to(self.before)
        return correct_bias(
            self.objective, self.points, settings.max_corrections, settings.seed, is_hopeless=is_hopeless
        )


def fit_with_law(before: SearchResult, law: Law, settings: SearchSettings) -> Fit:
    """Return the fit of the averaged model with the law."""
    return Fit.of(before, with_law(before.objective, law), law.name, settings)


def search_with_law(searched: SearchResult, name: str, settings: SearchSettings) -> SearchResult:
    """Return the estimate with the law `name`, from the estimate `searched` without it."""
    child = settings.child("hidden law", name)
    objective = with_law(searched.objective, LAWS[name])
    return search_with(searched, objective, name, child)


def search_with(
    searched: SearchResult,
    objective: MapObjective,
    name: str,
    settings: SearchSettings,
) -> SearchResult:
    """Return the estimate with the additional parameters of `objective`, called `name`.

    It is refined only if its residual is clearly smaller than that of `searched`: correct parameters reduce
    the residual before any refinement.
    """
    estimate = Fit.of(searched, objective, name, settings).corrected(settings)
    if is_residual_above(estimate, searched, LAW_SELECTION.clearly_less):
        return estimate
    return refine_by_reference(estimate, settings.seed)


def _current_cost(objective: MapObjective, point: Array, correction: Array | float) -> float:
    """Return the mean squared residual of the current [A²] at `point` (d,)."""
    residual = objective.residual(point, correction)[: objective.problem.samples]
    return float(np.mean(residual**2)) / float(objective.problem.weights[0]) ** 2


def without_law(tried: SearchResult, before: SearchResult, settings: SearchSettings) -> SearchResult:
    """Return the search without a law, repeated from the estimate `tried` with it.

    It has the description and the nuisances of the estimate `before`.
    """
    start = before.objective.space.carried_over(tried.point, tried.objective.space)
    child = settings.child("without a law")
    return correct_bias(before.objective, start[np.newaxis], child.max_corrections, child.seed)


def acts(result: SearchResult, law: Law, seed: int) -> bool:
    """Return whether a law has a significant effect at the estimate.

    If a law has no effect with all its parameters at 0, one of them must be significantly different from 0.
    Other laws always have an effect.
    """
    objective, point = result.objective, result.point
    actuator = objective.problem.actuator
    if not without_effect_at_zero(law, actuator):
        return True
    jacobians = jacobians_at(objective, point, stream(seed, "Jacobians of a second law"))
    local = local_covariance(objective, point, result.residual[: objective.channel_rows], jacobians)
    space, first = objective.space, len(objective.space.columns)
    errors = space.nuisances.standard_errors((local.covariance + result.scatter)[first:, first:])
    values = space.nuisance_values(point[np.newaxis])
    return any(
        abs(float(values[name][0])) > LAW_SELECTION.significant * error
        for name, error in zip(values, errors, strict=True)
        if name.removeprefix(BASELINE) in law.parameters
    )


def with_law(objective: MapObjective, law: Law) -> MapObjective:
    """Return the objective of the actuator with `law`, its parameters free like faults and nuisances.

    Parameters that act on the switching only stay fixed, because no search identifies them.
    """
    free = () if law.name in ONLY_WHILE_SWITCHING else law.parameters
    return with_free_law(objective, law, (*free, *law.also_free))


def with_free_law(objective: MapObjective, law: Law, names: tuple[str, ...]) -> MapObjective:
    """Return the objective of the actuator with `law`, and the parameters `names` free."""
    problem, nuisances = objective.problem, objective.space.nuisances
    actuator = law.added_to(problem.actuator)
    free = tuple(name for name in names if name not in nuisances.parameters)
    free = tuple(name for name in free if described_parts(actuator, name) is not None)
    motor = dict.fromkeys(MOTOR, DESCRIPTION_ERRORS.prior)
    return with_open(objective, actuator, ParameterVariation.suspected(actuator, free).known_to(motor))


def with_open(objective: MapObjective, actuator: Actuator, opened: ParameterVariation) -> MapObjective:
    """Return the objective of `actuator` with its parameters `opened` free in addition."""
    nuisances = objective.space.nuisances
    nuisances = nuisances.with_unit(nuisances.unit.combined_with(opened))
    problem = replace(objective.problem, actuator=actuator)
    return replace(objective, problem=problem, space=ParameterSpace.of(actuator, nuisances))
