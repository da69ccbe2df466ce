"""How the actuator and its sensors deviate from the description: nuisances and laws that nobody named."""

from dataclasses import replace

from emaphm.diagnosis.selection.hidden_laws import suspected_laws, with_hidden_law
from emaphm.diagnosis.selection.law_selection import select_laws
from emaphm.diagnosis.selection.nuisance_selection import select_nuisances, share_of_residual
from emaphm.diagnosis.selection.ripple import ripple_share
from emaphm.diagnosis.selection.sensor_lag import SENSOR_LAG, is_lag_suspected, with_sensor_lag
from emaphm.diagnosis.selection.settings import SELECTION
from emaphm.estimation.discrepancy import resolves_switching
from emaphm.estimation.methods import Method
from emaphm.estimation.search_result import SearchResult

Selection = tuple[SearchResult, tuple[str, ...], tuple[str, ...]]
"""An estimate, and the names of the nuisances and of the laws that were selected for it."""


def select_deviations(
    searched: SearchResult, method: Method, max_corrections: int, seed: int, *, moves: bool
) -> Selection:
    """Return the estimate with all that deviates significantly estimated too, and the names of that.

    Nuisances first; laws where they do not explain the recording, where the ripple shows a lag, or where the
    residual shows a law that hides. Standing, an actuator shows no law of its motion: none is tried unless it
    `moves`. Nor of a drive that does not switch: the few percent that are left of any machine are like laws.
    """
    found = select_nuisances(searched, max_corrections, seed)
    result, without = found.result, (found.result, found.names, ())
    if not (moves and resolves_switching(result.objective.problem)):
        return without
    if not result.explained:
        with_laws, laws = select_laws(searched, method, max_corrections, seed)
        if not laws:
            return replace(result, alternatives=with_laws.alternatives), found.names, ()
        return _with_nuisances(with_laws, laws, max_corrections, seed)
    if found.look.shows_lag and is_lag_suspected(result, seed):
        lagging = _with_lag(searched, result, method, max_corrections, seed)
        if lagging is not None:
            return lagging
    return _with_hidden_laws(searched, without, method, max_corrections, seed)


def _with_lag(
    searched: SearchResult, before: SearchResult, method: Method, max_corrections: int, seed: int
) -> Selection | None:
    """Return the estimate with a lag of the current sensors if it leaves clearly less of the ripple."""
    lagging = with_sensor_lag(searched, before, method, max_corrections, seed)
    if lagging is None:
        return None
    rival = _with_nuisances(lagging, (SENSOR_LAG,), max_corrections, seed)
    return rival if ripple_share(rival[0], before, seed) < SELECTION.likely_share else None


def _with_hidden_laws(
    searched: SearchResult, before: Selection, method: Method, max_corrections: int, seed: int
) -> Selection:
    """Return the estimate with the laws whose scores show them, while they leave clearly less.

    Or less, with fewer nuisances than were selected without: several make up for a small law.
    """
    best, base = before, searched
    while True:
        rivals = []
        for name in suspected_laws(best[0], seed):
            with_law = with_hidden_law(base, name, method, max_corrections, seed)
            rival = _with_nuisances(with_law, (*best[2], name), max_corrections, seed)
            share = share_of_residual(rival[0], best[0])
            if share < (1.0 if len(rival[1]) < len(best[1]) else SELECTION.likely_share):
                rivals.append((share, rival, with_law))
        if not rivals:
            return best
        _, best, base = min(rivals, key=lambda one: one[0])


def _with_nuisances(
    result: SearchResult, laws: tuple[str, ...], max_corrections: int, seed: int
) -> Selection:
    found = select_nuisances(result, max_corrections, seed)
    return replace(found.result, alternatives=result.alternatives), found.names, laws
