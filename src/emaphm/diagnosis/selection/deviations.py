"""How the actuator and its sensors deviate from the description: nuisances and laws that nobody named."""

from dataclasses import replace

from emaphm.actuator.laws import LAWS
from emaphm.diagnosis.selection.control_errors import with_control_errors, with_control_law
from emaphm.diagnosis.selection.description_errors import possible_errors, with_free
from emaphm.diagnosis.selection.laws.hidden_laws import HIDDEN_LAWS, suspected_laws
from emaphm.diagnosis.selection.laws.law_fit import acts, search_with_law, without_law
from emaphm.diagnosis.selection.laws.law_selection import select_laws
from emaphm.diagnosis.selection.laws.sensor_lag import SENSOR_LAG, is_lag_suspected, with_sensor_lag
from emaphm.diagnosis.selection.nuisance_selection import select_nuisances
from emaphm.diagnosis.selection.residual_share import share_of_residual
from emaphm.diagnosis.selection.ripple import ripple_share
from emaphm.diagnosis.selection.rotor_zero import with_rotor_zero
from emaphm.diagnosis.selection.selection import Selection
from emaphm.diagnosis.selection.settings import SELECTION
from emaphm.diagnosis.selection.varying_load import explains_better, is_convincing, with_varying_load
from emaphm.estimation.bias_correction import over_all_phases
from emaphm.estimation.discrepancy import resolves_switching
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.progress import Progress, subprogress

HALL_ANGLES = "hall-angles"


def select_deviations(
    searched: SearchResult,
    settings: SearchSettings,
    *,
    moves: bool,
    on_progress: Progress | None = None,
) -> Selection:
    """Return the estimate with all that deviates significantly estimated too, and the names of that.

    Gains of the control first, then nuisances; laws where they do not explain the recording, where the ripple
    shows a lag, or where the residual shows a law that hides; parameters of the description where there is no
    law. Standing, an actuator shows no law of its motion: none is tried unless it `moves`. Nor of a drive
    that does not switch: the few percent that are left of any machine are like laws. Where the residual
    exceeds what is expected at first, a load that varies is a rival of all these; of laws only where noise
    does not account for what it leaves.
    """
    if not searched.residual_is_expected:
        of_all_phases = over_all_phases(searched, settings.seed)
        searched = of_all_phases if of_all_phases.residual_is_expected else searched
    if not (moves and resolves_switching(searched.objective.problem)):
        return select_nuisances(searched, settings)
    report = on_progress or (lambda _: None)
    searched = with_control_errors(searched, settings)
    report(0.1)
    loaded = None if searched.residual_is_expected else with_varying_load(searched, settings)
    convincing = loaded is not None and is_convincing(loaded.result)
    on_progress = subprogress(on_progress, 0.1, 1.0 if loaded is None else 0.5)
    alone = _selection(searched, settings, on_progress, laws=not convincing)
    if loaded is None:
        return alone
    with_load = _selection(loaded.result, settings)
    if not explains_better(with_load.result, alone.result):
        return alone
    return replace(with_load, nuisances=(*loaded.nuisances, *with_load.nuisances))


def _selection(
    searched: SearchResult,
    settings: SearchSettings,
    on_progress: Progress | None = None,
    *,
    laws: bool = True,
) -> Selection:
    """Return `select_deviations` of an actuator that moves, but for its load; with `laws` or without."""
    report = on_progress or (lambda _: None)
    turned, found = _with_rotor_zero(searched, settings)
    report(0.4)
    if not (laws or found.result.residual_is_expected):
        return found
    controlled = with_control_law(searched, found, settings) if laws else None
    report(0.5)
    if controlled is not None:
        with_law = controlled.result
        share = share_of_residual(with_law, found.result)
        if share < SELECTION.likely_share or not found.result.residual_is_expected:
            selection = _with_nuisances(with_law, controlled.laws, settings)
            return _with_hidden_laws(with_law, selection, settings)
        if share < 1 / SELECTION.likely_share:  # either may be it
            found = found.with_alternatives((*found.result.alternatives, with_law))
    if turned is not searched:
        sensed = with_hall_angles(searched, found.result, settings)
        if sensed is not None:
            selection = _with_nuisances(sensed, (HALL_ANGLES,), settings)
            return _with_hidden_laws(sensed, selection, settings)
    selection = select_laws_in_motion(turned, found, settings)
    if selection.laws or not found.result.residual_is_expected:
        return selection
    return with_description_error(turned, selection, settings)


def select_laws_in_motion(searched: SearchResult, found: Selection, settings: SearchSettings) -> Selection:
    """Return the estimate with the laws that an actuator in motion shows, from that `searched` without them.

    And its nuisances; `found` has those that were selected without laws.
    """
    result = found.result
    if not result.residual_is_expected:
        selected = select_laws(searched, settings)
        if selected.laws or selected.result.residual_is_expected:
            return _with_nuisances(selected.result, selected.laws, settings)
        return found.with_alternatives(selected.result.alternatives)
    if found.look.shows_lag and is_lag_suspected(result, settings.seed):
        lagging = _with_lag(searched, result, settings)
        if lagging is not None and lagging.result.residual_is_expected:
            return lagging
    return _with_hidden_laws(searched, found, settings)


def _with_rotor_zero(searched: SearchResult, settings: SearchSettings) -> tuple[SearchResult, Selection]:
    """Return the estimate, with the rotor's zero where the recording shows another, and its nuisances.

    A zero that needs nuisances too is kept only if it leaves clearly less than they do without it.
    """
    turned = with_rotor_zero(searched, settings)
    found = select_nuisances(turned, settings)
    if turned is searched or not found.nuisances:
        return turned, found
    without_zero = select_nuisances(searched, settings)
    if share_of_residual(found.result, without_zero.result) < SELECTION.likely_share:
        return turned, found
    return searched, without_zero


def with_hall_angles(
    searched: SearchResult, turned: SearchResult, settings: SearchSettings
) -> SearchResult | None:
    """Return the estimate with Hall sensors out of place, from that `searched`, if it leaves clearly less.

    Than that with another zero of the rotor, `turned`: both move the commutation, but only with the sensors
    out of place does a phase conduct outside the flat of its back-EMF.
    """
    if not LAWS[HALL_ANGLES].is_possible(searched.objective.problem.actuator):
        return None
    sensed = search_with_law(searched, HALL_ANGLES, settings)
    leaves_less = sensed.residual_is_expected and share_of_residual(sensed, turned) < SELECTION.likely_share
    return sensed if leaves_less else None


def _with_lag(searched: SearchResult, before: SearchResult, settings: SearchSettings) -> Selection | None:
    """Return the estimate with a lag of the current sensors if it leaves clearly less of the ripple."""
    lagging = with_sensor_lag(searched, before, settings)
    if lagging is None:
        return None
    rival = _with_nuisances(lagging, (SENSOR_LAG,), settings)
    return rival if ripple_share(rival.result, before, settings.seed) < SELECTION.likely_share else None


def _with_hidden_laws(searched: SearchResult, before: Selection, settings: SearchSettings) -> Selection:
    """Return the estimate with the laws whose scores show them, while they leave clearly less.

    Or less, with fewer nuisances than were selected without: several make up for a small law. A law that has
    no effect where its parameters are 0 has one of them significant. Where a score is certain and the law
    leaves as much, either may be it: the estimate with it is an alternative.
    """
    best, base = before, searched
    while True:
        rivals = list[tuple[Selection, SearchResult, bool]]()
        for name, score in suspected_laws(best.result, settings.seed).items():
            with_law = search_with_law(base, name, settings)
            back = without_law(with_law, base, settings)
            if share_of_residual(back, best.result) < SELECTION.likely_share:
                # The law has led the search out of a place where it was held, and is perhaps not there.
                base, best = back, _with_nuisances(back, best.laws, settings)
            rival = _with_nuisances(with_law, (*best.laws, name), settings)
            if acts(rival.result, LAWS[name], settings.seed):
                rivals.append((rival, with_law, score.is_beyond(HIDDEN_LAWS.certain)))
        # Next to the best without them, which one of the laws may have led to.
        better, as_good = [], []
        for rival, with_law, certain in rivals:
            as_little = certain or len(rival.nuisances) < len(best.nuisances)
            share = share_of_residual(rival.result, best.result)
            if share < (1.0 if as_little else SELECTION.likely_share):
                better.append((share, rival, with_law))
            elif certain and rival.result.residual_is_expected and share < SELECTION.equal_share:
                as_good.append(rival.result)
        if not better:
            # What has no further alternatives keeps what it has computed.
            return best.with_alternatives((*best.result.alternatives, *as_good)) if as_good else best
        _, best, base = min(better, key=lambda one: one[0])


def with_description_error(searched: SearchResult, before: Selection, settings: SearchSettings) -> Selection:
    """Return the estimate with parameters of the description that are off, where they leave clearly less.

    Or as little, where one is certain to be off, or with fewer nuisances than were selected without: several
    make up for one parameter.
    """
    best = before
    for error in possible_errors(before.result, before.nuisances, settings.seed):
        corrected = with_free(searched, error.parameters, settings)
        rival = _with_nuisances(corrected, (), settings)
        if set(rival.nuisances) & set(error.instead_of):
            continue
        as_little = error.certain or len(rival.nuisances) < len(best.nuisances)
        least = SELECTION.equal_share if as_little else SELECTION.likely_share
        if share_of_residual(rival.result, best.result) < least:
            best = rival
        if not best.nuisances:
            break
    return best


def _with_nuisances(result: SearchResult, laws: tuple[str, ...], settings: SearchSettings) -> Selection:
    found = select_nuisances(result, settings)
    return replace(found.with_alternatives(result.alternatives), laws=laws)
