"""How the actuator and its sensors deviate from the description: nuisances and laws that nobody named."""

from dataclasses import replace

from emaphm.diagnosis.selection.law_selection import select_laws
from emaphm.diagnosis.selection.nuisance_selection import (
    SelectedNuisances,
    select_nuisances,
    share_of_residual,
)
from emaphm.diagnosis.selection.ripple import ripple_share
from emaphm.diagnosis.selection.saturation import SATURATION, is_saturation_suspected, with_saturation
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

    Nuisances first; laws where they do not explain the recording, where the ripple shows a lag, or where the
    residual shows a saturation. Standing, an actuator shows no law of its motion: none is tried unless it
    `moves`.
    """
    found = select_nuisances(searched, max_corrections, seed)
    result = found.result
    if not moves:
        return result, found.names, ()
    if not result.explained:
        with_laws, laws = select_laws(searched, method, max_corrections, seed)
        if not laws:
            return replace(result, alternatives=with_laws.alternatives), found.names, ()
        return _with_nuisances(with_laws, laws, max_corrections, seed)
    lagging = found.look.shows_lag and is_lag_suspected(result, seed)
    rival = _with_lag(searched, result, method, max_corrections, seed) if lagging else None
    if rival is None and is_saturation_suspected(result, seed):
        rival = _with_saturation(searched, found, method, max_corrections, seed)
    return rival or (result, found.names, ())


def _with_lag(
    searched: SearchResult, before: SearchResult, method: Method, max_corrections: int, seed: int
) -> Selection | None:
    """Return the estimate with a lag of the current sensors if it leaves clearly less of the ripple."""
    lagging = with_sensor_lag(searched, before, method, max_corrections, seed)
    if lagging is None:
        return None
    rival = _with_nuisances(lagging, (SENSOR_LAG,), max_corrections, seed)
    return rival if ripple_share(rival[0], before, seed) < SELECTION.likely_share else None


def _with_saturation(
    searched: SearchResult, before: SelectedNuisances, method: Method, max_corrections: int, seed: int
) -> Selection | None:
    """Return the estimate with a saturation if it leaves clearly less of the residual.

    Or less, with fewer nuisances than were selected `before`: several make up for a small one.
    """
    saturating = with_saturation(searched, method, max_corrections, seed)
    rival = _with_nuisances(saturating, (SATURATION,), max_corrections, seed)
    most = 1.0 if len(rival[1]) < len(before.names) else SELECTION.likely_share
    return rival if share_of_residual(rival[0], before.result) < most else None


def _with_nuisances(
    result: SearchResult, laws: tuple[str, ...], max_corrections: int, seed: int
) -> Selection:
    found = select_nuisances(result, max_corrections, seed)
    return replace(found.result, alternatives=result.alternatives), found.names, laws
