"""What is fitted: the description with its laws, and which of its parameters are free."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import LUMPED_PARAMETERS, check_lumped_parameters, lumped_parameters
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.conditions import SAME_PARAMETER
from emaphm.calibration.findings import LARGEST_ERROR
from emaphm.calibration.joint_correction import corrected_estimate
from emaphm.calibration.law_selection import Law, LawTrial, check_held_out, select_laws
from emaphm.calibration.unit_fit import FitSettings, fit_unit, fitted_parameters, searched
from emaphm.errors import MethodError, nearest
from emaphm.progress import Progress, subprogress

Laws: TypeAlias = Literal["auto"] | Sequence[str | Law] | None
"""Laws to add to a description: none, those named, or those that lower the error in recordings left out."""

AUTO = "auto"

USUAL = ("inertia", "viscous", "coulomb", "offset", "torque_constant", "resistance")
"""Parameters that are free where nobody names any, as far as the recordings identify them."""


@dataclass(frozen=True, eq=False)
class Description:
    """An actuator with the `laws` that were added to it, and its `free` parameters.

    `start` has coordinates of parameters to start from, by name; `selection` how the laws were chosen.
    """

    actuator: Actuator
    free: tuple[str, ...]
    laws: tuple[Law, ...] = ()
    start: Mapping[str, float] = field(default_factory=dict)
    selection: tuple[LawTrial, ...] = ()


def laws_named(laws: Laws, known: Mapping[str, Law]) -> tuple[Law, ...]:
    """Return the laws that are asked for, all that are `known` where they are chosen automatically.

    Raises
    ------
    MethodError
        A name is unknown.
    """
    if laws is None:
        return ()
    if isinstance(laws, str):
        laws = tuple(known) if laws == AUTO else (laws,)
    for law in laws:
        if isinstance(law, str) and law not in known:
            raise MethodError(f"unknown law '{law}'{nearest(law, (AUTO, *known))}")
    return tuple(dict.fromkeys(known[law] if isinstance(law, str) else law for law in laws))


def described_with_laws(
    rows: Sequence[CampaignRow],
    actuator: Actuator,
    free: Sequence[str] | None,
    laws: Laws,
    known: Mapping[str, Law],
    settings: FitSettings,
    on_progress: Progress | None = None,
) -> Description:
    """Return the description to fit to `rows`; parameters and errors as in `calibrate`."""
    asked = laws_named(laws, known)
    if laws == AUTO:
        check_held_out(rows)
    if free is None and laws is None:
        raise MethodError(
            f"no parameter to calibrate; name some of {', '.join(LUMPED_PARAMETERS)}, or laws to add"
        )
    names = tuple(dict.fromkeys(free)) if free is not None else _usual(rows, actuator, settings)
    if not names and not asked:
        raise MethodError(f"no parameter to calibrate; name some of {', '.join(LUMPED_PARAMETERS)}")
    if not asked:
        check_lumped_parameters(actuator, names)
        return Description(actuator, names)
    of_laws = {name for law in asked for name in law.parameters}
    base = tuple(name for name in names if name not in of_laws)
    check_lumped_parameters(actuator, base)
    if laws == AUTO:
        return _selected(rows, actuator, base, asked, settings, on_progress)
    extended = actuator
    for law in asked:
        extended = law.added_to(extended)
    every = tuple(dict.fromkeys((*names, *(name for law in asked for name in law.parameters))))
    # Without the laws there are fewer false minima: its fit is where that with them starts.
    start = searched(rows, actuator, fitted_parameters(rows, actuator, base), settings).start
    return Description(extended, every, asked, start)


def _selected(
    rows: Sequence[CampaignRow],
    actuator: Actuator,
    free: tuple[str, ...],
    candidates: Sequence[Law],
    settings: FitSettings,
    on_progress: Progress | None,
) -> Description:
    """Return the description with the laws that lower the error in recordings left out."""
    fitted = fitted_parameters(rows, actuator, free)
    found = searched(rows, actuator, fitted, settings)
    base = corrected_estimate(found.joint, found.point, settings.max_corrections, settings.seed)
    choice = select_laws(
        rows,
        base,
        actuator,
        fitted,
        candidates,
        settings,
        subprogress(on_progress, 0.1, 1.0),
    )
    every = tuple(dict.fromkeys((*free, *choice.free)))
    return Description(choice.actuator, every, choice.laws, choice.start, choice.trials)


def _usual(rows: Sequence[CampaignRow], actuator: Actuator, settings: FitSettings) -> tuple[str, ...]:
    """Return the usual parameters that the description has and the recordings identify."""
    known = {name for row in rows for name in (*row.known, *row.free)}
    estimated = actuator.nuisances.estimated if settings.nuisances is None else settings.nuisances
    # What is a nuisance of each recording is not estimated of all.
    taken = known | {SAME_PARAMETER[name] for name in estimated if name in SAME_PARAMETER}
    names = tuple(
        name
        for name in USUAL
        if name not in taken
        and (actuator.electrical is not None or name != "resistance")
        and (name == "offset" or lumped_parameters(actuator, (name,))[name] > 0)
    )
    if not names:
        return ()
    fit = fit_unit(rows, actuator, names, replace(settings, max_corrections=0))
    errors = zip(names, fit.standard_errors, fit.at_bound, strict=True)
    return tuple(name for name, error, at_bound in errors if error < LARGEST_ERROR and not at_bound)
