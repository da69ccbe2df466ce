"""Laws that the actuator shows although its description lacks them: tried where a recording is not explained.

A friction curve or a compliant shaft that nobody named is explained, as far as it can be, by faults: several
at once, and large. Each law of the library is therefore given to the actuator in turn, its parameters free,
and the whole search repeated. The law that leaves the smallest residual is kept, if it leaves clearly less.
"""

from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.actuator import described_parts
from emaphm.actuator.laws import LAWS, Law
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.arrays import Array
from emaphm.diagnosis.selection.settings import DESCRIPTION_ERRORS, MOTOR
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.global_search.multistart import local_search, multistart
from emaphm.estimation.methods import Method
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.reference.refinement import refine_by_reference
from emaphm.estimation.reference.scan import CURRENT_LAGS_S, scan
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.estimation.space.parameter_variation import ParameterVariation
from emaphm.estimation.uncertainty.local_covariance import jacobians_at, local_covariance
from emaphm.random_streams import child_seed, stream

SUSPECTS = (
    "stribeck",
    "transition",
    "presliding",
    "sensor-lag",
    "compliance",
    "load-dependent",
    "directional",
    "quadratic",
    "source-resistance",
    "cogging",
    "speed-lag",
    "speed-integral",
    "position-integral",
    "feedforward",
    "command-lag",
    "saturation",
    "inverter-drop",
    "emf-flats",
    "emf-sine",
    "hall-angles",
    "commutation-lag",
)
"""The laws that are tried, in this order."""


THROUGH_STANDSTILL = ("transition", "presliding")
"""Laws that exclude each other: one that explains more at first may stand in the way of the right one."""

FRICTION_CURVES = ("stribeck", "transition", "presliding", "load-dependent", "directional", "quadratic")
"""Those that together make a friction curve: where one explains a recording, another may be there too."""


ONLY_WHILE_SWITCHING = ("sensor-lag",)
"""Laws that hardly act on the averaged model: the reference model shows them, by a scan."""


LEAST_LAG_S, LONGER_LAG_S = CURRENT_LAGS_S[0], CURRENT_LAGS_S[4]
"""The lags [s] that are tried first, 2 and 8 µs."""


@dataclass(frozen=True)
class LawSelectionSettings:
    """When laws are tried, and which are kept; `make study` (limits, plants) measures them.

    Tried while the recording is not explained. All laws are fitted by the averaged model, from afar and from
    the estimate; the `corrected` best of each also with a correction of their own. One is kept that leaves
    less than `share` of the mean squared residual; `most` laws at most. A second law of the friction is also
    tried where the first explains the recording, and kept with less than `second_share`, which chance alone
    leaves seldom (0.92 to 1.03 of three recordings), and only if it acts: where a law has no effect with all
    of its parameters 0, one of them is `significant` standard errors from it.
    """

    corrected: int = 2
    share: float = 0.8
    second_share: float = 0.95
    significant: float = 2.0
    most: int = 4


LAW_SELECTION = LawSelectionSettings()


def select_laws(
    result: SearchResult, method: Method, max_corrections: int, seed: int
) -> tuple[SearchResult, tuple[str, ...]]:
    """Return the result with the laws that explain what it does not, and their names.

    Without any, it may still be another than before: a law gives the search a way out of a place where it was
    held, whether the actuator has the law or not. So the search without it is repeated from where it leads.

    Its alternatives are all other ends that were compared by the reference model.
    """
    first = _Trials(result, method, max_corrections, seed)
    found = _forward_selection(first, SUSPECTS)
    excluding = [name for name in found[1] if name in THROUGH_STANDSTILL]
    if found[0].explained or not excluding:
        return found
    others = tuple(name for name in SUSPECTS if name not in excluding)
    rival = _forward_selection(first, others)
    best, other = sorted((found, rival), key=lambda one: one[0].residual_variance)
    ends = (*best[0].alternatives, replace(other[0], alternatives=()), *other[0].alternatives)
    return replace(best[0], alternatives=ends), best[1]


@dataclass(frozen=True, eq=False)
class _Trials:
    """The laws that are tried from one estimate, `before` them; each is fitted once."""

    before: SearchResult
    method: Method
    max_corrections: int
    seed: int
    fits: dict[str, "LawFit"] = field(default_factory=dict)
    outcomes: dict[str, SearchResult | None] = field(default_factory=dict)

    def corrected(self, suspects: tuple[str, ...]) -> dict[str, SearchResult]:
        """Return the promising ones of `suspects`, their bias corrected by the reference model."""
        for name in suspects:
            if name not in self.fits and LAWS[name].is_possible(self.before.objective.problem.actuator):
                child = child_seed(self.seed, "law selection", name)
                self.fits[name] = fit_with_law(self.before, LAWS[name], self.method, child)
        found = {}
        for fit in _promising([self.fits[name] for name in suspects if name in self.fits]):
            if fit.law not in self.outcomes:
                self.outcomes[fit.law] = corrected_fit(fit, self.before, self.max_corrections, self.seed)
            outcome = self.outcomes[fit.law]
            if outcome is not None:
                found[fit.law] = outcome
        return found


def _forward_selection(trials: _Trials, allowed: tuple[str, ...]) -> tuple[SearchResult, tuple[str, ...]]:
    """Return `select_laws` with the laws `allowed`, one after another: the best at each time."""
    result, names = trials.before, tuple[str, ...]()
    max_corrections, seed = trials.max_corrections, trials.seed
    before = [result, *result.alternatives]
    ends = list(before)
    for _ in range(LAW_SELECTION.most):
        suspects = allowed if not result.explained else _second_of_friction(names)
        if trials.before is not result:
            trials = _Trials(result, trials.method, max_corrections, seed)
        outcomes = trials.corrected(suspects)
        if not outcomes:
            break
        ends += outcomes.values()
        law = min(outcomes, key=lambda name: outcomes[name].residual_variance)
        share = LAW_SELECTION.second_share if result.explained else LAW_SELECTION.share
        back = without_law(outcomes[law], result, max_corrections, seed)
        if back.residual_variance < result.residual_variance:
            ends.append(back)
            result = back
        if outcomes[law].residual_variance > share * result.residual_variance:
            break
        if result.explained and not acts(outcomes[law], LAWS[law], seed):
            break
        result, names = refine_by_reference(outcomes[law], seed), (*names, law)
        ends.remove(outcomes[law])
        ends.append(result)
    if len(ends) == len(before):
        return result, names
    others = tuple(replace(one, alternatives=()) for one in ends if one is not result)
    return replace(result, alternatives=others), names


def without_law(tried: SearchResult, before: SearchResult, max_corrections: int, seed: int) -> SearchResult:
    """Return where the search without a law ends from the estimate `tried` with it.

    By the description and the nuisances of the estimate `before`.
    """
    start = before.objective.space.carried_over(tried.point, tried.objective.space)
    child = child_seed(seed, "without a law")
    return correct_bias(before.objective, start[np.newaxis], max_corrections, child)


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


def _second_of_friction(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the laws to try where the one that was selected, of a friction curve, explains the recording."""
    return FRICTION_CURVES if len(names) == 1 and names[0] in FRICTION_CURVES else ()


@dataclass(frozen=True, eq=False)
class LawFit:
    """Where the averaged model with a `law` fits best: points (n, d) of the objective.

    `far` is the least cost [A²] of a new global search, `near` that of descents from the estimate without the
    law, under its correction: the first shows a law that has led the estimate astray, the second a small one.
    """

    law: str
    objective: MapObjective
    points: Array
    far: float
    near: float


def _promising(fits: list[LawFit]) -> list[LawFit]:
    """Return those that are best far from the estimate, or near it."""
    count = LAW_SELECTION.corrected
    far = sorted(fits, key=lambda one: one.far)[:count]
    near = sorted(fits, key=lambda one: one.near)[:count]
    return [one for one in fits if one in far or one in near or one.law in ONLY_WHILE_SWITCHING]


def fit_with_law(result: SearchResult, law: Law, method: Method, seed: int) -> LawFit:
    """Return where the averaged model fits best once its actuator has the law."""
    return fit_of(result, with_law(result.objective, law), law.name, method, seed)


def search_with_law(
    searched: SearchResult, name: str, method: Method, max_corrections: int, seed: int
) -> SearchResult:
    """Return the estimate with the law, from that `searched` without it."""
    child = child_seed(seed, "hidden law", name)
    objective = with_law(searched.objective, LAWS[name])
    return search_with(searched, objective, name, method, max_corrections, child)


def search_with(
    searched: SearchResult,
    objective: MapObjective,
    name: str,
    method: Method,
    max_corrections: int,
    seed: int,
) -> SearchResult:
    """Return the estimate with what `objective` has more than that `searched` without it: `name`."""
    fit = fit_of(searched, objective, name, method, seed)
    return refine_by_reference(correct_bias(fit.objective, fit.points, max_corrections, seed), seed)


def fit_of(result: SearchResult, objective: MapObjective, name: str, method: Method, seed: int) -> LawFit:
    """Return where the averaged model fits best with what `objective` has more than `result`: `name`."""
    found = multistart(objective, seed, method.optimizer)
    start = objective.space.carried_over(result.point, result.objective.space)
    correction = objective.of_channels(result.outputs_correction)
    near = local_search(objective, start, correction, stream(seed, "local search")).best
    return LawFit(
        name,
        objective,
        np.vstack([near, found.points]),
        min(_current_cost(objective, point, 0.0) for point in found.points),
        _current_cost(objective, near, correction),
    )


def _current_cost(objective: MapObjective, point: Array, correction: Array | float) -> float:
    """Return the mean squared residual of the current [A²] at `point` (d,)."""
    residual = objective.residual(point, correction)[: objective.problem.samples]
    return float(np.mean(residual**2)) / float(objective.problem.weights[0]) ** 2


def corrected_fit(fit: LawFit, before: SearchResult, max_corrections: int, seed: int) -> SearchResult | None:
    """Return the estimate with the law, its bias corrected by the reference model; None as `with_best_lag`.

    `before` is the estimate without it.
    """
    if fit.law in ONLY_WHILE_SWITCHING:
        return with_best_lag(fit, before, max_corrections, seed)
    child = child_seed(seed, "law selection, corrected", fit.law)
    return correct_bias(fit.objective, fit.points, max_corrections, child)


def with_best_lag(fit: LawFit, before: SearchResult, max_corrections: int, seed: int) -> SearchResult | None:
    """Return the estimate with the lag that the reference model prefers to the estimate `before` it.

    None where no lag is as good. The residual falls towards a lag that is there, and rises beyond: if a
    longer one leaves more than the least that is tried, the lag is hardly longer than that, and such a one
    must leave as much less than the estimate before as any law must.
    """
    child = child_seed(seed, "law selection, corrected", fit.law)

    @cache
    def with_lag(lag: float) -> SearchResult:
        problem = fit.objective.problem
        lagging = with_lumped_parameters(problem.actuator, {"current_lag": lag})
        objective = replace(fit.objective, problem=replace(problem, actuator=lagging))
        return correct_bias(objective, fit.points, max_corrections, child)

    least, longer = (with_lag(lag).residual_variance for lag in (LEAST_LAG_S, LONGER_LAG_S))
    if longer > least > LAW_SELECTION.share * before.residual_variance:
        return None
    found = scan(CURRENT_LAGS_S, with_lag, lambda one: one.residual_variance)
    # The value is anywhere between its neighbours: evenly so, a third of the square of the way to one.
    away = np.array([one.point - found.estimate.point for one in found.neighbours])
    between = away.T @ away / (3 * len(away))
    return replace(found.estimate, scatter=found.estimate.scatter + between)


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
