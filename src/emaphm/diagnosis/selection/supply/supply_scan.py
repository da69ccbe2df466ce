"""Estimation of a deviating supply: located by scans of the reference model, and fixed there."""

from dataclasses import replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.diagnosis.selection.extension import Candidate, with_nuisances
from emaphm.diagnosis.selection.supply.supply_profile import (
    SUPPLY,
    SUPPLY_SCAN,
    column_of,
    supply_profile,
    unit_of_supply,
)
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.space.nuisances import BASELINE, Located
from emaphm.random_streams import child_seed


def is_scanned(actuator: Actuator) -> bool:
    """Return whether the supply acts through the switching alone."""
    return actuator.drive_kind == "hysteresis"


def is_inductance_known(objective: MapObjective) -> bool:
    """Return whether the inductance is known to the step of a scan, so that the ripple identifies the supply.

    The slope of the ripple is voltage over inductance. If a tolerance or a baseline leaves the inductance
    open, another supply compensates for it: in 35 of 134 units within ± 20 % of the inductance a supply was
    selected, although all had the described supply.
    """
    nuisances = objective.space.nuisances
    deviations = dict(zip(nuisances.quantities, nuisances.prior_deviations, strict=True))
    return bool(deviations.get(f"{BASELINE}inductance", 0.0) <= SUPPLY_SCAN.step)


def supply_candidate(result: SearchResult, names: tuple[str, ...], seed: int) -> Candidate | None:
    """Return the candidate with another supply; None if the reference model fits the described one best.

    `names` were selected before.
    """
    objective, start = with_nuisances(result, names, (SUPPLY,))
    profile = supply_profile(objective, start, result.noise_level, seed, thorough=False)
    if profile.promising and not _is_certain(profile.located[0]):
        again = child_seed(seed, "supply scan, again")
        profile = profile.with_another(
            supply_profile(objective, start, result.noise_level, again, thorough=True)
        )
    located, share = profile.located
    if not profile.promising or abs(located.value) < located.deviation:
        return None
    objective, point = with_nuisances(result, names, (SUPPLY,), located={SUPPLY: located})
    return Candidate(SUPPLY, objective, point, share)


def with_supply(result: SearchResult, names: tuple[str, ...], settings: SearchSettings) -> SearchResult:
    """Return the result with its supply, which is already estimated, fixed where the scan locates it.

    The scan is repeated at each new estimate until the located supply does not change.
    """
    names = tuple(dict.fromkeys((*names, SUPPLY)))
    for i in range(SUPPLY_SCAN.corrections):
        child = settings.child("located supply", str(i))
        objective, start = with_nuisances(result, names, (), located={SUPPLY: None})
        profiles = [
            supply_profile(objective, start, result.noise_level, seed, thorough=True)
            for seed in (child.seed, child_seed(child.seed, "supply scan, again"))
        ]
        located, _ = profiles[0].with_another(profiles[1]).located
        before = result.objective.space.nuisances.located.get(SUPPLY)
        objective, point = with_nuisances(result, names, (), located={SUPPLY: located})
        if before is not None and abs(before.value - located.value) < SUPPLY_SCAN.step / 2:
            # The supply of the estimate is unchanged; only its location is updated.
            point[column_of(objective)] = _distance_from(result, located) / unit_of_supply(objective)
            return replace(result, objective=objective, point=point, known_outputs=None, jacobians=None)
        result = correct_bias(objective, point[np.newaxis], child.max_corrections, child.seed)
    return result


def with_requested_supply(result: SearchResult, settings: SearchSettings) -> SearchResult:
    """Return the result with a requested supply fixed where the scan locates it."""
    if SUPPLY in result.objective.space.nuisances.chosen and is_scanned(result.objective.problem.actuator):
        return with_supply(result, (), settings)
    return result


def is_off(result: SearchResult) -> bool:
    """Return whether the deviation of the located supply is certain."""
    return _is_certain(result.objective.space.nuisances.located[SUPPLY])


def _is_certain(located: Located) -> bool:
    """Return whether a located deviation exceeds its error by far enough."""
    return abs(located.value) > SUPPLY_SCAN.certain * located.deviation


def _distance_from(result: SearchResult, about: Located) -> float:
    """Return the distance of the supply in `result` from its location `about`."""
    return float(result.objective.space.nuisance_values(result.point[np.newaxis])[SUPPLY][0]) - about.value
