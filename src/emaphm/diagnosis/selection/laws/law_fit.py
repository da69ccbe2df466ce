"""Estimates with a law, or whatever else an objective has more than before.

A law may have led the estimate without it astray, or be a small one that hardly changes it. So it is searched
for from afar and from that estimate, and the reference model corrects the best of both.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.actuator import described_parts
from emaphm.actuator.laws import LAWS, Law
from emaphm.actuator.lumped_parameters import lumped_parameters
from emaphm.arrays import Array
from emaphm.diagnosis.selection.residual_share import hopeless_next_to, leaves_as_much
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
"""Laws that hardly act on the averaged model: the reference model shows them, by a scan."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Where the averaged model fits best with what `objective` has more than that of `before`: `name`.

    The points (n, d) are those of descents from the estimate before, under its correction, and of a new
    global search. `near` and `far` are the least costs [A²] of the two: the first shows what is small, the
    second what has led the estimate astray.
    """

    name: str
    before: SearchResult
    objective: MapObjective
    points: Array
    near: float
    far: float

    @classmethod
    def of(cls, before: SearchResult, objective: MapObjective, name: str, settings: SearchSettings) -> Self:
        """Return the fit of an `objective` that has more than that of `before`."""
        found = multistart(objective, settings.seed, settings.method.optimizer)
        start = objective.space.carried_over(before.point, before.objective.space)
        correction = objective.of_channels(before.outputs_correction)
        near = local_search(objective, start, correction, stream(settings.seed, "local search")).best
        return cls(
            name,
            before,
            objective,
            np.vstack([near, found.points]),
            _current_cost(objective, near, correction),
            min(_current_cost(objective, point, 0.0) for point in found.points),
        )

    def corrected(self, settings: SearchSettings) -> SearchResult:
        """Return the estimate, corrected by the reference model, or given up next to that before."""
        is_hopeless = hopeless_next_to(self.before)
        return correct_bias(
            self.objective, self.points, settings.max_corrections, settings.seed, is_hopeless=is_hopeless
        )


def fit_with_law(before: SearchResult, law: Law, settings: SearchSettings) -> Fit:
    """Return where the averaged model fits best once its actuator has the law."""
    return Fit.of(before, with_law(before.objective, law), law.name, settings)


def search_with_law(searched: SearchResult, name: str, settings: SearchSettings) -> SearchResult:
    """Return the estimate with the law, from that `searched` without it."""
    child = settings.child("hidden law", name)
    objective = with_law(searched.objective, LAWS[name])
    return search_with(searched, objective, name, child)


def search_with(
    searched: SearchResult,
    objective: MapObjective,
    name: str,
    settings: SearchSettings,
) -> SearchResult:
    """Return the estimate with what `objective` has more than that `searched` without it: `name`.

    One that leaves hardly less is not refined: what is right leaves less at once, if not yet as little as it
    can.
    """
    found = Fit.of(searched, objective, name, settings).corrected(settings)
    if leaves_as_much(found, searched, LAW_SELECTION.clearly_less):
        return found
    return refine_by_reference(found, settings.seed)


def _current_cost(objective: MapObjective, point: Array, correction: Array | float) -> float:
    """Return the mean squared residual of the current [A²] at `point` (d,)."""
    residual = objective.residual(point, correction)[: objective.problem.samples]
    return float(np.mean(residual**2)) / float(objective.problem.weights[0]) ** 2


def without_law(tried: SearchResult, before: SearchResult, settings: SearchSettings) -> SearchResult:
    """Return where the search without a law ends from the estimate `tried` with it.

    By the description and the nuisances of the estimate `before`.
    """
    start = before.objective.space.carried_over(tried.point, tried.objective.space)
    child = settings.child("without a law")
    return correct_bias(before.objective, start[np.newaxis], child.max_corrections, child.seed)


def acts(result: SearchResult, law: Law, seed: int) -> bool:
    """Return whether a law has an effect at the estimate, where it has none with its parameters at 0.

    Any of them is then significantly different from 0. A law that always acts, whatever their values, does.
    """
    objective, point = result.objective, result.point
    actuator = objective.problem.actuator
    described = tuple(name for name in law.parameters if described_parts(actuator, name) is not None)
    if any(lumped_parameters(actuator, described).values()):
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

    But for what acts on the switching only, which no search finds.
    """
    own = () if law.name in ONLY_WHILE_SWITCHING else law.parameters
    return with_free_law(objective, law, (*own, *law.also_free))


def with_free_law(objective: MapObjective, law: Law, names: tuple[str, ...]) -> MapObjective:
    """Return the objective of the actuator with `law`, and the parameters `names` free."""
    problem, nuisances = objective.problem, objective.space.nuisances
    actuator = law.added_to(problem.actuator)
    free = tuple(name for name in names if name not in nuisances.parameters)
    free = tuple(name for name in free if described_parts(actuator, name) is not None)
    motor = dict.fromkeys(MOTOR, DESCRIPTION_ERRORS.prior)
    return with_open(objective, actuator, ParameterVariation.suspected(actuator, free).known_to(motor))


def with_open(objective: MapObjective, actuator: Actuator, opened: ParameterVariation) -> MapObjective:
    """Return the objective of `actuator`, with what is `opened` of its parameters free too."""
    nuisances = objective.space.nuisances
    nuisances = nuisances.with_unit(nuisances.unit.combined_with(opened))
    problem = replace(objective.problem, actuator=actuator)
    return replace(objective, problem=problem, space=ParameterSpace.of(actuator, nuisances))
