"""Forward selection of laws that the description lacks.

Laws are tried if the residual of an estimate exceeds the expected size.

Several large faults together compensate in part for a friction curve or a compliant shaft that is not
described. Each law of the library is therefore added to the actuator in turn, with its parameters free, and
the whole search is repeated. The law with the smallest residual is kept, if its residual is clearly smaller.
"""

from dataclasses import dataclass, field, replace

from emaphm.actuator.laws import LAWS
from emaphm.diagnosis.selection.laws.law_fit import (
    ONLY_WHILE_SWITCHING,
    Fit,
    acts,
    fit_with_law,
    without_law,
)
from emaphm.diagnosis.selection.laws.sensor_lag import with_best_lag
from emaphm.diagnosis.selection.selection import Selection
from emaphm.diagnosis.selection.settings import LAW_SELECTION
from emaphm.estimation.reference.refinement import refine_by_reference
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.threads import in_threads

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
"""Laws that exclude each other: the one that is selected first may prevent the selection of the right one."""

FRICTION_CURVES = ("stribeck", "transition", "presliding", "load-dependent", "directional", "quadratic")
"""Laws that may act together in a friction curve: if one explains a recording, a second one is tried."""


def select_laws(result: SearchResult, settings: SearchSettings) -> Selection:
    """Return the result with the selected laws.

    The result may also change without any law, because a trial with a law may lead the search out of a local
    minimum: the search without the law is repeated from the end point of each trial.

    The alternatives of the result are all other end points that were compared by the reference model.
    """
    first = _Trials(result, settings)
    selection = _forward_selection(first, SUSPECTS)
    excluding = [name for name in selection.laws if name in THROUGH_STANDSTILL]
    if selection.result.residual_is_expected or not excluding:
        return selection
    allowed = tuple(name for name in SUSPECTS if name not in excluding)
    rival = _forward_selection(first, allowed)
    best, second = sorted((selection, rival), key=lambda candidate: candidate.result.residual_variance)
    end = replace(second.result, alternatives=())
    return best.with_alternatives((*best.result.alternatives, end, *second.result.alternatives))


@dataclass(frozen=True, eq=False)
class _Trials:
    """Trials of laws from one estimate `before`; each law is fitted once."""

    before: SearchResult
    settings: SearchSettings
    fits: dict[str, Fit] = field(default_factory=dict)
    outcomes: dict[str, SearchResult | None] = field(default_factory=dict)

    def corrected(self, suspects: tuple[str, ...]) -> dict[str, SearchResult]:
        """Return the estimates with the promising laws of `suspects`, corrected by the reference model."""
        problem = self.before.objective.problem
        possible = [name for name in suspects if LAWS[name].is_possible(problem.actuator)]
        fitted = in_threads(self._fit, [name for name in possible if name not in self.fits], problem.workers)
        self.fits.update((fit.name, fit) for fit in fitted)
        promising = _promising([self.fits[name] for name in possible])
        uncorrected = [fit for fit in promising if fit.name not in self.outcomes]
        outcomes = in_threads(self._corrected, uncorrected, problem.workers)
        self.outcomes.update((fit.name, outcome) for fit, outcome in zip(uncorrected, outcomes, strict=True))
        results = {fit.name: self.outcomes[fit.name] for fit in promising}
        return {name: outcome for name, outcome in results.items() if outcome is not None}

    def _fit(self, name: str) -> Fit:
        """Return the fit with the law `name`."""
        return fit_with_law(self.before, LAWS[name], self.settings.child("law selection", name))

    def _corrected(self, fit: Fit) -> SearchResult | None:
        """Return the corrected estimate with the law; None as in `with_best_lag`."""
        if fit.name in ONLY_WHILE_SWITCHING:
            return with_best_lag(fit, fit.before, self.settings)
        return fit.corrected(self.settings.child("law selection, corrected", fit.name))


def _forward_selection(trials: _Trials, allowed: tuple[str, ...]) -> Selection:
    """Return the selection among the laws `allowed`: one law after another, always the best one."""
    result, names = trials.before, tuple[str, ...]()
    settings = trials.settings
    first_ends = [result, *result.alternatives]
    ends = list(first_ends)
    for _ in range(LAW_SELECTION.most):
        suspects = allowed if not result.residual_is_expected else _second_of_friction(names)
        if trials.before is not result:
            trials = _Trials(result, settings)
        outcomes = trials.corrected(suspects)
        if not outcomes:
            break
        ends += outcomes.values()
        law = min(outcomes, key=lambda name: outcomes[name].residual_variance)
        share = LAW_SELECTION.clearly_less if result.residual_is_expected else LAW_SELECTION.share
        repeated = without_law(outcomes[law], result, settings)
        if repeated.residual_variance < result.residual_variance:
            ends.append(repeated)
            result = repeated
        if outcomes[law].residual_variance > share * result.residual_variance:
            break
        if result.residual_is_expected and not acts(outcomes[law], LAWS[law], settings.seed):
            break
        result, names = refine_by_reference(outcomes[law], settings.seed), (*names, law)
        ends.remove(outcomes[law])
        ends.append(result)
    if len(ends) == len(first_ends):
        return Selection(result, laws=names)
    alternatives = tuple(replace(end, alternatives=()) for end in ends if end is not result)
    return Selection(replace(result, alternatives=alternatives), laws=names)


def _second_of_friction(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the second laws to try if the recording is explained with one selected friction law."""
    return FRICTION_CURVES if len(names) == 1 and names[0] in FRICTION_CURVES else ()


def _promising(fits: list[Fit]) -> list[Fit]:
    """Return the best fits of the global search and of the descents from the estimate."""
    count = LAW_SELECTION.corrected
    far = sorted(fits, key=lambda fit: fit.far)[:count]
    near = sorted(fits, key=lambda fit: fit.near)[:count]
    return [fit for fit in fits if fit in far or fit in near or fit.name in ONLY_WHILE_SWITCHING]
