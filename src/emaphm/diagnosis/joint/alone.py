"""What each recording of a joint diagnosis asks for by itself.

That gives the starts of the joint fit, what deviates significantly from the description in any of the
recordings, and the estimates that are compared for contradictions.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self, TypeVar

import numpy as np

from emaphm.actuator import Actuator
from emaphm.diagnosis.diagnose import objective_for, without_spoilt_rows
from emaphm.diagnosis.explanation.motion import moves_at
from emaphm.diagnosis.identifiability import identifiability
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
from emaphm.diagnosis.selection.rotor_zero import is_sought, with_rotor_zero, with_zero_near, zero_of
from emaphm.diagnosis.selection.selection import Selection
from emaphm.diagnosis.selection.supply.supply_scan import with_asked_supply
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
from emaphm.progress import Progress
from emaphm.recording.sensor_checks import CheckedRecording
from emaphm.simulation import AVERAGED
from emaphm.threads import in_threads

T = TypeVar("T")

METHOD = "hybrid"
"""How each recording is searched by itself."""

LEAST_SHARE = 1 / 3
"""Share of the recordings that must show a parameter to be off: half of those of such a unit do, one in a
hundred by chance."""


@dataclass(frozen=True, eq=False)
class _Alone:
    """One recording's estimate: as `searched`, and as `found`, with the nuisances that deviate.

    `load` is what it was searched with of a load that varies, which nobody asked for.
    """

    searched: SearchResult
    found: Selection
    settings: SearchSettings
    load: tuple[str, ...] = ()

    @property
    def result(self) -> SearchResult:
        """The estimate with what was found."""
        return self.found.result

    @property
    def parameters(self) -> tuple[str, ...]:
        """Parameters of the description that the result has free, though nobody asked for them."""
        return tuple(name.removeprefix(BASELINE) for name in suspected_parameters(self.result))

    @property
    def is_corrected(self) -> bool:
        """Whether the reference model, which switches, was asked."""
        return self.searched.discrepancy is not None and resolves_switching(self.searched.objective.problem)

    @property
    def moves(self) -> bool:
        """Whether the actuator moved."""
        return moves_at(self.result.objective, self.result.point)

    def find_laws(self) -> tuple[str, ...]:
        """Return the laws that the recording alone shows, but for one that no search finds."""
        if not self.moves:
            return ()
        selection = select_laws_in_motion(self.searched, self.found, self.settings)
        return tuple(name for name in selection.laws if name not in ONLY_WHILE_SWITCHING)

    def search_with_laws(self, laws: Sequence[str]) -> Self:
        """Return the estimate with `laws`."""
        searched = self.searched
        for name in laws:
            searched = search_with_law(searched, name, self.settings)
        return self.selecting(searched)

    def with_description_error(self) -> Self:
        """Return the estimate with parameters free that are off.

        Where the actuator moves and the residual without them is expected.
        """
        if not (self.result.residual_is_expected and self.moves):
            return self
        found = with_description_error(self.searched, self.found, self.settings)
        return replace(self, found=found)

    def with_control_errors(self) -> Self:
        """Return the estimate with gains of the control free that are off, where it moves."""
        if not self.moves:
            return self
        searched = with_control_errors(self.searched, self.settings)
        return self if searched is self.searched else self.selecting(searched)

    def with_varying_load(self) -> Self:
        """Return the estimate with a load of its own that varies, where that explains it better."""
        if self.searched.residual_is_expected or not (self.is_corrected and self.moves):
            return self
        loaded = with_varying_load(self.searched, self.settings)
        if loaded is None:
            return self
        rival = self.selecting(loaded.result)
        return replace(rival, load=loaded.nuisances) if explains_better(rival.result, self.result) else self

    def selecting(self, searched: SearchResult) -> Self:
        """Return the estimate as `searched`, with the nuisances that deviate significantly from there."""
        return replace(self, searched=searched, found=select_nuisances(searched, self.settings))


@dataclass(frozen=True, eq=False)
class AloneSearches:
    """Where the search of each recording alone ends, and what was selected.

    `selected` are the quantities that were selected in any of them and are estimated of all, `laws` those
    that the description lacks.
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
    """Return where the search of each recording alone ends, and what was selected in any of them.

    Nuisances that deviate significantly, laws, and parameters that are not as described: what is selected for
    one is estimated of all. Arguments as of `emaphm.diagnosis.joint.diagnose_joint`.
    """

    def searched(r: int) -> _Alone:
        checked = recordings[r]
        objective = objective_for(checked.recording, actuator, settings.method, AVERAGED, nuisances, workers)
        objective = without_spoilt_rows(objective, checked)
        # The first one's streams are those of a diagnosis of it alone.
        own = settings if r == 0 else settings.child("recording", r)
        result = search(objective, own, fitness="least_squares")
        if result.discrepancy is not None:
            result = with_asked_supply(result, own)
        searched_alone = _Alone(result, Selection(result), own)
        if nuisances is None and result.discrepancy is not None:
            searched_alone = searched_alone.selecting(result)
        return searched_alone

    found, laws = in_threads(searched, range(len(recordings)), workers, on_progress), tuple[str, ...]()
    if nuisances is None:
        found, laws = _with_deviations(found)
    selected = tuple(dict.fromkeys(name for one in found for name in one.found.nuisances))
    alone = [_with_all(one.result, one.found.nuisances, selected, settings) for one in found]
    load = dict.fromkeys(name for one in found for name in one.load)
    return AloneSearches(alone, (*load, *selected, *suspected_parameters(alone[0])), laws)


def _with_deviations(found: list[_Alone]) -> tuple[list[_Alone], tuple[str, ...]]:
    """Return the estimates with what of the unit is not as described, common to all, and the laws among that.

    And with loads that vary, of each its own.
    """
    corrected = all(one.is_corrected for one in found)
    if corrected:
        asked = _of_each(found, _Alone.with_control_errors)
        found = _with_common_parameters(found, asked)
    found = _of_each(found, _Alone.with_varying_load)
    if not corrected:
        return found, ()
    found, sensors = _with_common_zero(found)
    found, others = _with_common_laws(found)
    if not (sensors or others):
        asked = _of_each(found, _Alone.with_description_error)
        found = _with_common_parameters(found, asked)
    return found, (*sensors, *others)


def _with_common_zero(found: list[_Alone]) -> tuple[list[_Alone], tuple[str, ...]]:
    """Return the estimates with the rotor's zero, common to all, where a recording shows that it is off.

    Or with the law of Hall sensors out of place, where that leaves clearly less of it; and the law's name.
    """
    if not all(is_sought(one.searched.objective) for one in found):
        return found, ()
    for one in found:
        if not moves_at(one.searched.objective, one.searched.point):
            continue
        shown = with_rotor_zero(one.searched, one.settings)
        if not is_sought(shown.objective):  # it is free now
            return _with_zero_of(one, shown, found)
    return found, ()


def _with_zero_of(
    one: _Alone, shown: SearchResult, found: list[_Alone]
) -> tuple[list[_Alone], tuple[str, ...]]:
    """Return `_with_common_zero` where `one` of the recordings has `shown` another zero."""
    turned = one.selecting(shown)
    sensed = with_hall_angles(one.searched, turned.result, one.settings)

    def with_sensors(each: _Alone) -> _Alone:
        if each is one and sensed is not None:
            return each.selecting(sensed)
        return each.search_with_laws((HALL_ANGLES,))

    def with_zero(each: _Alone) -> _Alone:
        if each is one:
            return turned
        near = zero_of(shown)
        return each.selecting(with_zero_near(each.searched, near, each.settings))

    if sensed is not None:
        return _of_each(found, with_sensors), (HALL_ANGLES,)
    return _of_each(found, with_zero), ()


def _with_common_laws(found: list[_Alone]) -> tuple[list[_Alone], tuple[str, ...]]:
    """Return the estimates with laws that the description lacks, common to all, and the names of these.

    Those of the first whose residual exceeds what is expected, if more residuals are as expected with them;
    where all are, those that a share of `LEAST_SHARE` shows.
    """
    exceeding = [one for one in found if not one.result.residual_is_expected and one.moves]
    asked = _of_each(exceeding[:1] or found, _Alone.find_laws)
    counts = Counter(name for laws in asked for name in laws)
    laws = tuple(name for name, count in counts.items() if count >= LEAST_SHARE * len(asked))
    if not laws:
        return found, ()
    with_them = _of_each(found, lambda one: one.search_with_laws(laws))
    expected, before = (sum(one.result.residual_is_expected for one in each) for each in (with_them, found))
    return (with_them, laws) if expected > before or not exceeding else (found, ())


def _with_common_parameters(found: list[_Alone], asked: list[_Alone]) -> list[_Alone]:
    """Return the estimates with parameters free, in all, that are off in `LEAST_SHARE` of them at least.

    `asked` are those `found` with the parameters free that each shows by itself.
    """
    open_before = found[0].parameters
    counts = Counter(name for one in asked for name in one.parameters if name not in open_before)
    free = tuple(name for name, count in counts.items() if count >= LEAST_SHARE * len(found))
    if not free:
        return found

    def with_these(one: _Alone) -> _Alone:
        if set(one.parameters) == {*open_before, *free}:
            return one
        searched = with_free(one.searched, free, one.settings)
        return one.selecting(searched)

    return _of_each(asked, with_these)


def _of_each(found: Sequence[_Alone], function: Callable[[_Alone], T]) -> list[T]:
    """Return what `function` makes of each estimate, of several at once."""
    return in_threads(function, found, found[0].searched.objective.problem.workers)


def _with_all(
    result: SearchResult, names: tuple[str, ...], selected: tuple[str, ...], settings: SearchSettings
) -> SearchResult:
    """Return the result with the nuisances `selected` in any recording estimated of this one too."""
    problem, estimated = result.objective.problem, result.objective.space.nuisances
    possible = estimated.others(problem.actuator, tuple(problem.measured))
    more = tuple(name for name in selected if name not in names and name in possible)
    if not more:
        return result
    objective, point = with_nuisances(result, names, more)
    child = settings.child("nuisances of other recordings")
    return correct_bias(objective, point[np.newaxis], child.max_corrections, child.seed)


def alone_estimates(alone: Sequence[SearchResult], joint: JointObjective, seed: int) -> AloneEstimates | None:
    """Return what each recording alone asks for; None of one recording."""
    if len(alone) == 1:
        return None
    places = [term.shared_places for term in joint.terms]
    points = np.array([one.point[at] for one, at in zip(alone, places, strict=True)])
    covariances = np.array(
        [identifiability(one, seed).covariance[np.ix_(at, at)] for one, at in zip(alone, places, strict=True)]
    )
    meta = random_effects(points, covariances, joint.prior_deviations[: joint.shared])
    return AloneEstimates(points, covariances, np.ones(len(alone)), meta)
