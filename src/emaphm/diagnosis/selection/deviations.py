"""Selection of all deviations of actuator and sensors from the description."""

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
    """Return the estimate with all significant deviations estimated, and their names.

    Gains of the control are tested first, then nuisances. Laws are tested if these do not explain the
    recording, if the ripple indicates a lag, or if the residual indicates a hidden law; parameters of the
    description if no law was selected. If the residual exceeds the expected size at first, a varying load
    competes with all other deviations, except laws if its residual is no more than noise.

    Only nuisances are tested if the actuator does not move, because laws are then not identifiable, or if its
    drive does not switch, because the residual of a few percent that remains for any machine resembles laws.
    """
    if not searched.residual_is_expected:
        all_phases = over_all_phases(searched, settings.seed)
        searched = all_phases if all_phases.residual_is_expected else searched
    if not (moves and resolves_switching(searched.objective.problem)):
        return select_nuisances(searched, settings)
    report = on_progress or (lambda _: None)
    searched = with_control_errors(searched, settings)
    report(0.1)
    loaded = None if searched.residual_is_expected else with_varying_load(searched, settings)
    convincing = loaded is not None and is_convincing(loaded.result)
    on_progress = subprogress(on_progress, 0.1, 1.0 if loaded is None else 0.5)
    without_load = _selection(searched, settings, on_progress, laws=not convincing)
    if loaded is None:
        return without_load
    with_load = _selection(loaded.result, settings)
    if not explains_better(with_load.result, without_load.result):
        return without_load
    return replace(with_load, nuisances=(*loaded.nuisances, *with_load.nuisances))


def _selection(
    searched: SearchResult,
    settings: SearchSettings,
    on_progress: Progress | None = None,
    *,
    laws: bool = True,
) -> Selection:
    """Return `select_deviations` of a moving actuator, without a varying load; with or without `laws`."""
    report = on_progress or (lambda _: None)
    with_zero, selected = _with_rotor_zero(searched, settings)
    report(0.4)
    if not (laws or selected.result.residual_is_expected):
        return selected
    controlled = with_control_law(searched, selected, settings) if laws else None
    report(0.5)
    if controlled is not None:
        with_law = controlled.result
        share = share_of_residual(with_law, selected.result)
        if share < SELECTION.likely_share or not selected.result.residual_is_expected:
            selection = _with_nuisances(with_law, controlled.laws, settings)
            return _with_hidden_laws(with_law, selection, settings)
        if share < 1 / SELECTION.likely_share:  # equally good: intervals cover both
            selected = selected.with_alternatives((*selected.result.alternatives, with_law))
    if with_zero is not searched:
        with_hall_law = with_hall_angles(searched, selected.result, settings)
        if with_hall_law is not None:
            selection = _with_nuisances(with_hall_law, (HALL_ANGLES,), settings)
            return _with_hidden_laws(with_hall_law, selection, settings)
    selection = select_laws_in_motion(with_zero, selected, settings)
    if selection.laws or not selected.result.residual_is_expected:
        return selection
    return with_description_error(with_zero, selection, settings)


def select_laws_in_motion(searched: SearchResult, found: Selection, settings: SearchSettings) -> Selection:
    """Return the estimate of a moving actuator with the selected laws, and nuisances selected with them.

    `searched` is the estimate without laws, `found` the selection of nuisances without laws.
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
    """Return the estimate, with the rotor's zero free if the recording indicates a deviation, and nuisances.

    If nuisances are selected with the zero, it is kept only if the residual is clearly smaller than with the
    nuisances that are selected without it.
    """
    with_zero = with_rotor_zero(searched, settings)
    selection = select_nuisances(with_zero, settings)
    if with_zero is searched or not selection.nuisances:
        return with_zero, selection
    without_zero = select_nuisances(searched, settings)
    if share_of_residual(selection.result, without_zero.result) < SELECTION.likely_share:
        return with_zero, selection
    return searched, without_zero


def with_hall_angles(
    searched: SearchResult, turned: SearchResult, settings: SearchSettings
) -> SearchResult | None:
    """Return the estimate with displaced Hall sensors if its residual is clearly smaller; else None.

    It is compared with the estimate `turned` with another zero of the rotor: both shift the commutation, but
    only with displaced sensors does a phase conduct outside the flat of its back-EMF. `searched` is the
    estimate without either.
    """
    if not LAWS[HALL_ANGLES].is_possible(searched.objective.problem.actuator):
        return None
    with_law = search_with_law(searched, HALL_ANGLES, settings)
    has_smaller_residual = (
        with_law.residual_is_expected and share_of_residual(with_law, turned) < SELECTION.likely_share
    )
    return with_law if has_smaller_residual else None


def _with_lag(searched: SearchResult, before: SearchResult, settings: SearchSettings) -> Selection | None:
    """Return the estimate with a lag of the current sensors if the ripple's residual is clearly smaller."""
    lagging = with_sensor_lag(searched, before, settings)
    if lagging is None:
        return None
    rival = _with_nuisances(lagging, (SENSOR_LAG,), settings)
    return rival if ripple_share(rival.result, before, settings.seed) < SELECTION.likely_share else None


def _with_hidden_laws(searched: SearchResult, before: Selection, settings: SearchSettings) -> Selection:
    """Return the estimate with the laws that have significant scores and a clearly smaller residual.

    If the score is certain, or fewer nuisances are needed with the law, a smaller residual is enough: several
    nuisances can compensate for a small law. A law that has no effect with its parameters at 0 must have a
    significant parameter. If the score is certain and the residual is equal, the estimate with the law is
    added to the alternatives.
    """
    best, start = before, searched
    while True:
        rivals = list[tuple[Selection, SearchResult, bool]]()
        for name, score in suspected_laws(best.result, settings.seed).items():
            with_law = search_with_law(start, name, settings)
            repeated = without_law(with_law, start, settings)
            if share_of_residual(repeated, best.result) < SELECTION.likely_share:
                # The law has led the search out of a local minimum, and may not be present.
                start, best = repeated, _with_nuisances(repeated, best.laws, settings)
            rival = _with_nuisances(with_law, (*best.laws, name), settings)
            if acts(rival.result, LAWS[name], settings.seed):
                rivals.append((rival, with_law, score.is_beyond(HIDDEN_LAWS.certain)))
        # The comparison is with the best estimate without the laws, which a law may have led to.
        better, alternatives = [], []
        for rival, with_law, certain in rivals:
            is_favoured = certain or len(rival.nuisances) < len(best.nuisances)
            share = share_of_residual(rival.result, best.result)
            if share < (1.0 if is_favoured else SELECTION.likely_share):
                better.append((share, rival, with_law))
            elif certain and rival.result.residual_is_expected and share < SELECTION.equal_share:
                alternatives.append(rival.result)
        if not better:
            # Without further alternatives, the result is unchanged and keeps its cached properties.
            return (
                best.with_alternatives((*best.result.alternatives, *alternatives)) if alternatives else best
            )
        _, best, start = min(better, key=lambda entry: entry[0])


def with_description_error(searched: SearchResult, before: Selection, settings: SearchSettings) -> Selection:
    """Return the estimate with deviating parameters of the description, if the residual is clearly smaller.

    If a deviation is certain, or fewer nuisances are needed, an equal residual is enough: several nuisances
    can compensate for one parameter.
    """
    best = before
    for error in possible_errors(before.result, before.nuisances, settings.seed):
        corrected = with_free(searched, error.parameters, settings)
        rival = _with_nuisances(corrected, (), settings)
        if set(rival.nuisances) & set(error.instead_of):
            continue
        is_favoured = error.certain or len(rival.nuisances) < len(best.nuisances)
        largest_share = SELECTION.equal_share if is_favoured else SELECTION.likely_share
        if share_of_residual(rival.result, best.result) < largest_share:
            best = rival
        if not best.nuisances:
            break
    return best


def _with_nuisances(result: SearchResult, laws: tuple[str, ...], settings: SearchSettings) -> Selection:
    """Return the selection of nuisances for a `result` with `laws`."""
    selection = select_nuisances(result, settings)
    return replace(selection.with_alternatives(result.alternatives), laws=laws)
