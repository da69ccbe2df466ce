"""Laws that the actuator shows although its description lacks them.

They are tried where the residual of an estimate exceeds what is expected.

Faults make up for a friction curve or a compliant shaft that nobody named, as far as they can: several at
once, and large. Each law of the library is therefore given to the actuator in turn, its parameters free,
and the whole search repeated. The law that leaves the smallest residual is kept, if it leaves clearly less.
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
"""Laws that exclude each other: one that explains more at first may stand in the way of the right one."""

FRICTION_CURVES = ("stribeck", "transition", "presliding", "load-dependent", "directional", "quadratic")
"""Those that together make a friction curve: where one explains a recording, another may be there too."""


def select_laws(result: SearchResult, settings: SearchSettings) -> Selection:
    """Return the result with the laws that explain what it does not.

    Without any, it may still be another than before: a law gives the search a way out of a place where it was
    held, whether the actuator has the law or not. So the search without it is repeated from where it leads.

    Its alternatives are all other ends that were compared by the reference model.
    """
    first = _Trials(result, settings)
    found = _forward_selection(first, SUSPECTS)
    excluding = [name for name in found.laws if name in THROUGH_STANDSTILL]
    if found.result.residual_is_expected or not excluding:
        return found
    others = tuple(name for name in SUSPECTS if name not in excluding)
    rival = _forward_selection(first, others)
    best, other = sorted((found, rival), key=lambda one: one.result.residual_variance)
    end = replace(other.result, alternatives=())
    return best.with_alternatives((*best.result.alternatives, end, *other.result.alternatives))


@dataclass(frozen=True, eq=False)
class _Trials:
    """The laws that are tried from one estimate, `before` them; each is fitted once."""

    before: SearchResult
    settings: SearchSettings
    fits: dict[str, Fit] = field(default_factory=dict)
    outcomes: dict[str, SearchResult | None] = field(default_factory=dict)

    def corrected(self, suspects: tuple[str, ...]) -> dict[str, SearchResult]:
        """Return the promising ones of `suspects`, their bias corrected by the reference model."""
        problem = self.before.objective.problem
        possible = [name for name in suspects if LAWS[name].is_possible(problem.actuator)]
        fitted = in_threads(self._fit, [name for name in possible if name not in self.fits], problem.workers)
        self.fits.update((fit.name, fit) for fit in fitted)
        promising = _promising([self.fits[name] for name in possible])
        new = [fit for fit in promising if fit.name not in self.outcomes]
        outcomes = in_threads(self._corrected, new, problem.workers)
        self.outcomes.update((fit.name, outcome) for fit, outcome in zip(new, outcomes, strict=True))
        found = {fit.name: self.outcomes[fit.name] for fit in promising}
        return {name: outcome for name, outcome in found.items() if outcome is not None}

    def _fit(self, name: str) -> Fit:
        return fit_with_law(self.before, LAWS[name], self.settings.child("law selection", name))

    def _corrected(self, fit: Fit) -> SearchResult | None:
        """Return the estimate with the law, corrected by the reference model; None as `with_best_lag`."""
        if fit.name in ONLY_WHILE_SWITCHING:
            return with_best_lag(fit, fit.before, self.settings)
        return fit.corrected(self.settings.child("law selection, corrected", fit.name))


def _forward_selection(trials: _Trials, allowed: tuple[str, ...]) -> Selection:
    """Return `select_laws` with the laws `allowed`, one after another: the best at each time."""
    result, names = trials.before, tuple[str, ...]()
    settings = trials.settings
    before = [result, *result.alternatives]
    ends = list(before)
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
        back = without_law(outcomes[law], result, settings)
        if back.residual_variance < result.residual_variance:
            ends.append(back)
            result = back
        if outcomes[law].residual_variance > share * result.residual_variance:
            break
        if result.residual_is_expected and not acts(outcomes[law], LAWS[law], settings.seed):
            break
        result, names = refine_by_reference(outcomes[law], settings.seed), (*names, law)
        ends.remove(outcomes[law])
        ends.append(result)
    if len(ends) == len(before):
        return Selection(result, laws=names)
    others = tuple(replace(one, alternatives=()) for one in ends if one is not result)
    return Selection(replace(result, alternatives=others), laws=names)


def _second_of_friction(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the laws to try where the one that was selected, of a friction curve, explains the recording."""
    return FRICTION_CURVES if len(names) == 1 and names[0] in FRICTION_CURVES else ()


def _promising(fits: list[Fit]) -> list[Fit]:
    """Return those that are best far from the estimate, or near it."""
    count = LAW_SELECTION.corrected
    far = sorted(fits, key=lambda one: one.far)[:count]
    near = sorted(fits, key=lambda one: one.near)[:count]
    return [one for one in fits if one in far or one in near or one.name in ONLY_WHILE_SWITCHING]
