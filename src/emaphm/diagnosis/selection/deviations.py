"""How the actuator and its sensors deviate from the description: nuisances and laws that nobody named."""

from dataclasses import replace

from emaphm.diagnosis.selection.law_selection import select_laws
from emaphm.diagnosis.selection.nuisance_selection import select_nuisances
from emaphm.diagnosis.selection.ripple import ripple_share
from emaphm.diagnosis.selection.sensor_lag import SENSOR_LAG, is_lag_suspected, with_sensor_lag
from emaphm.diagnosis.selection.settings import SELECTION
from emaphm.estimation.methods import Method
from emaphm.estimation.search_result import SearchResult

Selection = tuple[SearchResult, tuple[str, ...], tuple[str, ...]]
"""An estimate, and the names of the nuisances and of the laws that were selected for it."""


def select_deviations(
    searched: SearchResult, method: Method, max_corrections: int, seed: int, *, moves: bool
) -> Selection:
    """Return the estimate with all that deviates significantly estimated too, and the names of that.

    Nuisances first; laws where they do not explain the recording, or where the ripple shows a lag. Standing,
    an actuator shows no law of its motion: none is tried unless it `moves`.
    """
    found = select_nuisances(searched, max_corrections, seed)
    result = found.result
    without = result, found.names, ()
    if not moves:
        return without
    if not result.explained:
        with_laws, laws = select_laws(searched, method, max_corrections, seed)
        if not laws:
            return replace(result, alternatives=with_laws.alternatives), found.names, ()
        return _with_nuisances(with_laws, laws, max_corrections, seed)
    if found.look.shows_lag and is_lag_suspected(result, seed):
        lagging = with_sensor_lag(searched, result, method, max_corrections, seed)
        if lagging is None:
            return without
        rival = _with_nuisances(lagging, (SENSOR_LAG,), max_corrections, seed)
        if ripple_share(rival[0], result, seed) < SELECTION.likely_share:
            return rival
    return without


def _with_nuisances(
    result: SearchResult, laws: tuple[str, ...], max_corrections: int, seed: int
) -> Selection:
    found = select_nuisances(result, max_corrections, seed)
    return replace(found.result, alternatives=result.alternatives), found.names, laws
