"""Description to be fitted: the actuator with its added laws, and its free parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from emaphm.actuator import Actuator
from emaphm.actuator.laws import Law, law_named
from emaphm.actuator.laws.calibrated import SHOWN_BY_FAULTS, check_calibrated, laws_to_calibrate
from emaphm.actuator.lumped_parameters import LUMPED_PARAMETERS, check_lumped_parameters, lumped_parameters
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.conditions import SAME_PARAMETER
from emaphm.calibration.findings import LARGEST_ERROR
from emaphm.calibration.law_selection import (
    LawTrial,
    check_held_out,
    parameters_of,
    select_laws,
    typical_motor_speed,
)
from emaphm.calibration.unit_fit import FitSettings, fit_unit, fitted_parameters, searched
from emaphm.errors import MethodError
from emaphm.estimation.joint.correction import corrected_estimate
from emaphm.progress import Progress, subprogress

Laws: TypeAlias = str | Sequence[str] | None
"""Laws to add to a description: none, named laws, or "auto" for a selection by held-out recordings."""

AUTO = "auto"

MECHANICS = ("inertia", "viscous", "coulomb")
"""Parameters that are free by default."""

FURTHER = ("offset", "torque_constant", "resistance")
"""Further parameters that are free by default if the recordings identify them."""


@dataclass(frozen=True, eq=False)
class Description:
    """Actuator with the `laws` that were added to it, and its `free` parameters.

    `start` are start values by name, in the coordinates of a fit; `selection` are the trials of the law
    selection; `law_notes` are sentences on laws that were added without it.
    """

    actuator: Actuator
    free: tuple[str, ...]
    laws: tuple[Law, ...] = ()
    start: Mapping[str, float] = field(default_factory=dict)
    selection: tuple[LawTrial, ...] = ()
    law_notes: tuple[str, ...] = ()


def laws_named(laws: Laws, actuator: Actuator) -> tuple[Law, ...]:
    """Return the requested laws; for "auto", all laws that the actuator may have.

    Raises
    ------
    MethodError
        A name is unknown, or the actuator cannot have the law.
    """
    if laws is None:
        return ()
    if laws == AUTO:
        return laws_to_calibrate(actuator)
    names = (laws,) if isinstance(laws, str) else tuple(laws)
    if not names:
        some = ", ".join(law.name for law in laws_to_calibrate(actuator))
        raise MethodError(f"no law to add; name some of {some}, or '{AUTO}'")
    if AUTO in names:
        raise MethodError(f"law '{AUTO}' stands for a choice among all; give it alone, or name the laws")
    # The laws that a law requires precede it.
    ordered = [needed for name in names for needed in (*law_named(name).needs, name)]
    return tuple(law_named(name) for name in dict.fromkeys(ordered))


def described_with_laws(
    rows: Sequence[CampaignRow],
    actuator: Actuator,
    free: Sequence[str] | None,
    laws: Laws,
    settings: FitSettings,
    on_progress: Progress | None = None,
) -> Description:
    """Return the description to fit to `rows`; parameters and raised errors are those of `calibrate`."""
    requested = laws_named(laws, actuator)
    if laws == AUTO:
        check_held_out(rows)
    if free is None and laws is None:
        raise MethodError(
            f"no parameter to calibrate; name some of {', '.join(LUMPED_PARAMETERS)}, or laws to add"
        )
    names = _default_free(rows, actuator, settings) if free is None else tuple(free)
    # A parameter with a tolerance, if assumed exact, would bias the other parameters.
    toleranced = [n for n in settings.known if n not in _not_shared(rows, actuator, settings)]
    names = tuple(dict.fromkeys((*names, *toleranced)))
    if not names and not requested:
        raise MethodError(f"no parameter to calibrate; name some of {', '.join(LUMPED_PARAMETERS)}")
    of_laws = {name for law in requested for name in law.parameters}
    check_calibrated((*names, *of_laws))
    base = tuple(name for name in names if name not in of_laws)
    check_lumped_parameters(actuator, base)
    if laws == AUTO:
        return _with_selected_laws(rows, actuator, base, requested, settings, on_progress)
    if not requested:
        return Description(actuator, names)
    # The fit without the laws has fewer local minima; the fit with the laws starts from it.
    without = searched(rows, actuator, fitted_parameters(rows, actuator, base or MECHANICS), settings)
    speed, extended = typical_motor_speed(without.joint), actuator
    for law in requested:
        extended = extended if law.is_in(extended) else law.added_to(extended, speed)
    all_free = (*names, *(name for law in requested for name in parameters_of(law, extended)))
    return Description(extended, tuple(dict.fromkeys(all_free)), requested, without.start)


def _with_selected_laws(
    rows: Sequence[CampaignRow],
    actuator: Actuator,
    free: tuple[str, ...],
    candidates: Sequence[Law],
    settings: FitSettings,
    on_progress: Progress | None,
) -> Description:
    """Return the description with the laws that lower the error in recordings left out of the fit."""
    fitted = fitted_parameters(rows, actuator, free)
    without = searched(rows, actuator, fitted, settings)
    base = corrected_estimate(without.joint, without.point, settings.max_corrections, settings.seed)
    choice = select_laws(
        rows,
        base,
        actuator,
        fitted,
        candidates,
        settings,
        subprogress(on_progress, 0.1, 1.0),
    )
    all_free = tuple(dict.fromkeys((*free, *choice.free)))
    return Description(choice.actuator, all_free, choice.laws, choice.start, choice.trials)


def _not_shared(rows: Sequence[CampaignRow], actuator: Actuator, settings: FitSettings) -> set[str]:
    """Return the parameters that are not estimated from all recordings together.

    They are known or free in a row, have the same effect as an estimated nuisance, or are identifiable only
    under faults (`SHOWN_BY_FAULTS`).
    """
    known = {name for row in rows for name in (*row.known, *row.free)}
    estimated = actuator.nuisances.estimated if settings.nuisances is None else settings.nuisances
    return known | SHOWN_BY_FAULTS | {SAME_PARAMETER[name] for name in estimated if name in SAME_PARAMETER}


def _default_free(rows: Sequence[CampaignRow], actuator: Actuator, settings: FitSettings) -> tuple[str, ...]:
    """Return the default free parameters that the description has and the recordings identify."""
    settled = _not_shared(rows, actuator, settings)
    names = tuple(
        name
        for name in (*MECHANICS, *FURTHER)
        if name not in settled
        and (actuator.electrical is not None or name != "resistance")
        and (name == "offset" or lumped_parameters(actuator, (name,))[name] > 0)
    )
    if not set(names) - set(MECHANICS):
        return names
    fit = fit_unit(rows, actuator, names, replace(settings, max_corrections=0))
    known_well = (fit.standard_errors < LARGEST_ERROR) & ~fit.at_bound
    return tuple(name for name, known in zip(names, known_well, strict=True) if known or name in MECHANICS)
