"""Separate searches of the recordings of a joint diagnosis.

Their results are the starting points of the joint fit, the parameters that deviate significantly from the
description in any recording, and the estimates that are compared for contradictions.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self, TypeVar

import numpy as np

from emaphm.actuator import Actuator
from emaphm.diagnosis.explanation.motion import moves_at
from emaphm.diagnosis.identifiability import identifiability
from emaphm.diagnosis.posing import objective_for, without_spoilt_rows
from emaphm.diagnosis.selection.control_errors import with_control_errors
from emaphm.diagnosis.selection.description_errors import suspected_parameters, with_free
from emaphm.diagnosis.selection.deviations import (
    HALL_ANGLES,
    select_laws_in_motion,
    with_description_error,
    with_hall_angles,
)
from emaphm.diagnosis.selection.extension import with_nuisances
from emaphm.diagnosis.selection.laws.law_fit import ONLY_WHILE_SWITCHING, search_with_law
from emaphm.diagnosis.selection.nuisance_selection import select_nuisances
from emaphm.diagnosis.selection.rotor_zero import is_zero_searched, with_rotor_zero, with_zero_near, zero_of
from emaphm.diagnosis.selection.selection import Selection
from emaphm.diagnosis.selection.supply.supply_scan import with_requested_supply
from emaphm.diagnosis.selection.varying_load import explains_better, with_varying_load
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.discrepancy import resolves_switching
from emaphm.estimation.joint.objective import JointObjective
from emaphm.estimation.joint.random_effects import random_effects
from emaphm.estimation.joint.uncertainty import AloneEstimates
from emaphm.estimation.search import search
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.uncertainty.local_covariance import moves_slowly
from emaphm.progress import Progress
from emaphm.recording.sensor_checks import CheckedRecording
from emaphm.simulation import AVERAGED
from emaphm.threads import in_threads

T = TypeVar("T")

METHOD = "hybrid"
"""Search method of the separate searches."""

LEAST_SHARE = 1 / 3
"""Share of the recordings that must indicate a deviation of a parameter: half of the recordings of a
deviating unit do, and one in a hundred of others by chance."""


@dataclass(frozen=True, eq=False)
class _Alone:
    """The separate estimate of one recording.

    `searched` is the estimate before, `selection` after the selection of deviating nuisances. `load` are the
    nuisances of a varying load that was selected without a request.
    """

    searched: SearchResult
    selection: Selection
    settings: SearchSettings
    load: tuple[str, ...] = ()

    @property
    def result(self) -> SearchResult:
        """The estimate with the selected nuisances."""
        return self.selection.result

    @property
    def parameters(self) -> tuple[str, ...]:
        """Free parameters of the description that were selected without a request."""
        return tuple(name.removeprefix(BASELINE) for name in suspected_parameters(self.result))

    @property
    def is_corrected(self) -> bool:
        """Whether the reference model, with its switching, has corrected the estimate."""
        return self.searched.discrepancy is not None and resolves_switching(self.searched.objective.problem)

    @property
    def moves(self) -> bool:
        """Whether the actuator moved."""
        return moves_at(self.result.objective, self.result.point)

    def find_laws(self) -> tuple[str, ...]:
        """Return the laws selected for this recording alone, without a lag of the current sensors."""
        if not self.moves:
            return ()
        selection = select_laws_in_motion(self.searched, self.selection, self.settings)
        return tuple(name for name in selection.laws if name not in ONLY_WHILE_SWITCHING)

    def search_with_laws(self, laws: Sequence[str]) -> Self:
        """Return the estimate with `laws`."""
        searched = self.searched
        for name in laws:
            searched = search_with_law(searched, name, self.settings)
        return self.selecting(searched)

    def with_description_error(self) -> Self:
        """Return the estimate with deviating parameters of the description free.

        They are tested if the actuator moves and the residual without them is expected.
        """
        if not (self.result.residual_is_expected and self.moves):
            return self
        selection = with_description_error(self.searched, self.selection, self.settings)
        return replace(self, selection=selection)

    def with_control_errors(self) -> Self:
        """Return the estimate with deviating gains of the control free, if the actuator moves."""
        if not self.moves:
            return self
        searched = with_control_errors(self.searched, self.settings)
        return self if searched is self.searched else self.selecting(searched)

    def with_varying_load(self) -> Self:
        """Return the estimate with a varying load of this recording, if that explains it better."""
        if self.searched.residual_is_expected or not (self.is_corrected and self.moves):
            return self
        loaded = with_varying_load(self.searched, self.settings)
        if loaded is None:
            return self
        rival = self.selecting(loaded.result)
        return replace(rival, load=loaded.nuisances) if explains_better(rival.result, self.result) else self

    def selecting(self, searched: SearchResult) -> Self:
        """Return the estimate from `searched`, with the nuisances that deviate significantly."""
        return replace(self, searched=searched, selection=select_nuisances(searched, self.settings))


@dataclass(frozen=True, eq=False)
class AloneSearches:
    """Results of the separate searches.

    `selected` are the quantities that were selected in any recording and are estimated in all, `laws` the
    selected laws that the description lacks.
    """

    results: list[SearchResult]
    selected: tuple[str, ...]
    laws: tuple[str, ...]


def search_alone(
    recordings: Sequence[CheckedRecording],
    actuator: Actuator,
    nuisances: Sequence[str] | None,
    settings: SearchSettings,
    workers: int | None,
    on_progress: Progress | None,
) -> AloneSearches:
    """Return the results of the separate searches, and the quantities selected in any of them.

    Nuisances that deviate significantly, laws, and parameters that deviate from the description are selected;
    a selected quantity is estimated in all recordings. Arguments as in
    `emaphm.diagnosis.joint.diagnose_joint`.
    """

    def estimate_of(r: int) -> _Alone:
        checked = recordings[r]
        objective = objective_for(checked.recording, actuator, settings.method, AVERAGED, nuisances, workers)
        objective = without_spoilt_rows(objective, checked)
        # The first recording has the random streams of its single diagnosis.
        own_settings = settings if r == 0 else settings.child("recording", r)
        result = search(objective, own_settings, fitness="least_squares")
        if result.discrepancy is not None:
            result = with_requested_supply(result, own_settings)
        estimate = _Alone(result, Selection(result), own_settings)
        if nuisances is None and result.discrepancy is not None:
            estimate = estimate.selecting(result)
        return estimate

    estimates, laws = in_threads(estimate_of, range(len(recordings)), workers, on_progress), tuple[str, ...]()
    if nuisances is None:
        estimates, laws = _with_deviations(estimates)
    selected = tuple(dict.fromkeys(name for estimate in estimates for name in estimate.selection.nuisances))
    alone = [
        _with_all(estimate.result, estimate.selection.nuisances, selected, settings) for estimate in estimates
    ]
    load = dict.fromkeys(name for estimate in estimates for name in estimate.load)
    return AloneSearches(alone, (*load, *selected, *suspected_parameters(alone[0])), laws)


def _with_deviations(estimates: list[_Alone]) -> tuple[list[_Alone], tuple[str, ...]]:
    """Return the estimates with deviations of the unit, common to all recordings, and the selected laws.

    Each recording may also get a varying load of its own.
    """
    corrected = all(estimate.is_corrected for estimate in estimates)
    if corrected:
        freed = _of_each(estimates, _Alone.with_control_errors)
        estimates = _with_common_parameters(estimates, freed)
    estimates = _of_each(estimates, _Alone.with_varying_load)
    if not corrected:
        return estimates, ()
    estimates, hall_laws = _with_common_zero(estimates)
    estimates, other_laws = _with_common_laws(estimates)
    if not (hall_laws or other_laws):
        freed = _of_each(estimates, _Alone.with_description_error)
        estimates = _with_common_parameters(estimates, freed)
    return estimates, (*hall_laws, *other_laws)


def _with_common_zero(estimates: list[_Alone]) -> tuple[list[_Alone], tuple[str, ...]]:
    """Return the estimates with a common zero of the rotor, if a recording indicates that it deviates.

    If displaced Hall sensors give a clearly smaller residual, return the estimates with that law instead, and
    its name.
    """
    if not all(is_zero_searched(estimate.searched.objective) for estimate in estimates):
        return estimates, ()
    for estimate in estimates:
        if not moves_at(estimate.searched.objective, estimate.searched.point):
            continue
        turned = with_rotor_zero(estimate.searched, estimate.settings)
        if not is_zero_searched(turned.objective):  # it is free now
            return _with_zero_of(estimate, turned, estimates)
    return estimates, ()


def _with_zero_of(
    first: _Alone, with_zero: SearchResult, estimates: list[_Alone]
) -> tuple[list[_Alone], tuple[str, ...]]:
    """Return `_with_common_zero` from the estimate `first`, which indicates another zero."""
    turned = first.selecting(with_zero)
    sensed = with_hall_angles(first.searched, turned.result, first.settings)

    def with_hall_law(other: _Alone) -> _Alone:
        if other is first and sensed is not None:
            return other.selecting(sensed)
        return other.search_with_laws((HALL_ANGLES,))

    def with_same_zero(other: _Alone) -> _Alone:
        if other is first:
            return turned
        near = zero_of(with_zero)
        return other.selecting(with_zero_near(other.searched, near, other.settings))

    if sensed is not None:
        return _of_each(estimates, with_hall_law), (HALL_ANGLES,)
    return _of_each(estimates, with_same_zero), ()


def _with_common_laws(estimates: list[_Alone]) -> tuple[list[_Alone], tuple[str, ...]]:
    """Return the estimates with common laws that the description lacks, and the names of these laws.

    If residuals exceed the expected size, these are the laws of the first such recording, kept if more
    residuals have the expected size with them. Otherwise these are the laws that at least `LEAST_SHARE` of
    the recordings indicate.
    """
    exceeding = [
        estimate for estimate in estimates if not estimate.result.residual_is_expected and estimate.moves
    ]
    indicated = _of_each(exceeding[:1] or estimates, _Alone.find_laws)
    counts = Counter(name for laws in indicated for name in laws)
    laws = tuple(name for name, count in counts.items() if count >= LEAST_SHARE * len(indicated))
    if not laws:
        return estimates, ()
    with_laws = _of_each(estimates, lambda estimate: estimate.search_with_laws(laws))
    expected, before = (
        sum(estimate.result.residual_is_expected for estimate in group) for group in (with_laws, estimates)
    )
    return (with_laws, laws) if expected > before or not exceeding else (estimates, ())


def _with_common_parameters(estimates: list[_Alone], freed: list[_Alone]) -> list[_Alone]:
    """Return the estimates with the parameters free, in all, that deviate in at least `LEAST_SHARE` of them.

    `freed` are the `estimates` with the deviating parameters of each recording free.
    """
    open_before = estimates[0].parameters
    counts = Counter(name for estimate in freed for name in estimate.parameters if name not in open_before)
    free = tuple(name for name, count in counts.items() if count >= LEAST_SHARE * len(estimates))
    if not free:
        return estimates

    def with_free_parameters(estimate: _Alone) -> _Alone:
        if set(estimate.parameters) == {*open_before, *free}:
            return estimate
        searched = with_free(estimate.searched, free, estimate.settings)
        return estimate.selecting(searched)

    return _of_each(freed, with_free_parameters)


def _of_each(estimates: Sequence[_Alone], function: Callable[[_Alone], T]) -> list[T]:
    """Return the value of `function` for each estimate, computed in threads."""
    return in_threads(function, estimates, estimates[0].searched.objective.problem.workers)


def _with_all(
    result: SearchResult, names: tuple[str, ...], selected: tuple[str, ...], settings: SearchSettings
) -> SearchResult:
    """Return the result with all nuisances that were `selected` in any recording estimated."""
    problem, estimated = result.objective.problem, result.objective.space.nuisances
    possible = estimated.others(problem.actuator, tuple(problem.measured))
    added = tuple(name for name in selected if name not in names and name in possible)
    if not added:
        return result
    objective, point = with_nuisances(result, names, added)
    child = settings.child("nuisances of other recordings")
    return correct_bias(objective, point[np.newaxis], child.max_corrections, child.seed)


def alone_estimates(alone: Sequence[SearchResult], joint: JointObjective, seed: int) -> AloneEstimates | None:
    """Return the separate estimates and their meta-analysis; None for a single recording."""
    if len(alone) == 1:
        return None
    shared_columns = [term.shared_places for term in joint.terms]
    points = np.array([result.point[columns] for result, columns in zip(alone, shared_columns, strict=True)])
    covariances = np.array(
        [
            identifiability(result, seed).covariance[np.ix_(columns, columns)]
            for result, columns in zip(alone, shared_columns, strict=True)
        ]
    )
    meta = random_effects(points, covariances, joint.prior_deviations[: joint.shared])
    return AloneEstimates(points, covariances, np.ones(len(alone)), meta)


def with_better_fits(
    estimates: AloneEstimates,
    alone: Sequence[SearchResult],
    together: Sequence[SearchResult],
    joint: JointObjective,
    *,
    slow_only: bool = False,
) -> AloneEstimates:
    """Return the separate estimates, with the joint estimate of each recording that it fits as well.

    The optimum may lie in a long valley, above all in a slow motion, and a separate search may end far from
    the others although the recording contains no evidence against them. The linear covariance does not show
    this. The residuals by the reference model do: `together` are the joint estimate as a result of each
    recording. Covariances remain those of the separate estimates. With `slow_only`, only recordings of slow
    motions are compared: the residuals have random errors of some percent, which would hide a small scatter
    between other recordings.
    """
    points = estimates.points.copy()
    for r, (separate, common) in enumerate(zip(alone, together, strict=True)):
        if slow_only and not moves_slowly(separate.objective.problem):
            continue
        if _fits_as_well(common, separate):
            points[r] = common.point[joint.terms[r].shared_places]
    meta = random_effects(points, estimates.covariances, joint.prior_deviations[: joint.shared])
    return replace(estimates, points=points, meta=meta)


def _fits_as_well(common: SearchResult, separate: SearchResult) -> bool:
    """Return whether the residual of `common` is not larger, with the weights of `separate`."""
    objective = separate.objective

    def misfit(result: SearchResult) -> float:
        square = float(np.mean(objective.rescaled(result.residual, result.objective) ** 2))
        if result.discrepancy is None:
            return square
        error = objective.rescaled(result.discrepancy.standard_error, result.objective)
        return square - float(np.mean(error**2))

    return misfit(common) <= misfit(separate)
