"""Test of a drive of another kind than described.

The current of a brushless motor is controlled by comparators, or by a PI controller with pulse-width
modulation; the motor's data sheet does not state which. The dynamics of the current differ, and no law or
fault compensates for this.
"""

import math
from typing import Any

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import lumped_parameters
from emaphm.diagnosis.selection.description_errors import SPEED_LOOP
from emaphm.diagnosis.selection.laws.law_fit import with_open
from emaphm.diagnosis.selection.residual_share import share_of_residual
from emaphm.diagnosis.selection.settings import CURRENT_CONTROL
from emaphm.errors import DivergedError
from emaphm.estimation.search import search
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.space.parameter_variation import ParameterVariation

OTHER_KINDS = {"hysteresis": "six-step", "six-step": "hysteresis"}
"""For each kind of drive, the other kind for the same motor."""

GAINS = {"hysteresis": SPEED_LOOP, "six-step": (*SPEED_LOOP, *CURRENT_CONTROL)}
"""Gains that are estimated with the faults, by kind: the speed loop is tuned to the current loop."""

USUAL_BANDWIDTH_HZ, USUAL_PWM_HZ, WITHIN = 400.0, 2e4, 0.7
"""Usual bandwidth and PWM frequency of a PI current control, and the prior standard deviation of the
logarithms of the gains: they are searched within a factor of 16 in both directions."""

MOST_LEFT = {True: 0.8, False: 0.25}
"""Largest share of the mean squared residual with the drive of another kind: if it explains the recording,
and if it does not, because its modulation may have another frequency."""

USUAL_HYSTERESIS = 0.02
"""Usual hysteresis of comparators, relative to the current limit."""


def other_drive(searched: SearchResult, selected: SearchResult, settings: SearchSettings) -> tuple[str, ...]:
    """Return a sentence if the residual with a drive of another kind is far smaller; nothing otherwise.

    It is compared with `selected`, the estimate with all selected deviations; `searched` is the estimate with
    the description.
    """
    objective = searched.objective
    kind = OTHER_KINDS.get(objective.problem.actuator.drive_kind)
    if kind is None:
        return ()
    actuator = with_drive(objective.problem.actuator, kind)
    free = objective.space.nuisances.parameters
    gains = tuple(name for name in GAINS[kind] if name not in free)
    opened = ParameterVariation.free(actuator, gains).known_to(dict.fromkeys(gains, WITHIN))
    child = settings.child("another kind of drive")
    try:
        rival = search(
            with_open(objective, actuator, opened),
            child,
            fitness="least_squares",
            is_hopeless=lambda rival: share_of_residual(rival, selected) > MOST_LEFT[True],
        )
    except DivergedError:
        return ()
    share = share_of_residual(rival, selected)
    if share > MOST_LEFT[rival.residual_is_expected]:
        return ()
    present = objective.problem.actuator.drive_kind
    reason = (
        f"a drive of kind '{kind}', with {_gains_as_text(rival, gains)}, has {100 * share:.2g} % of the mean "
        f"squared residual of the described kind '{present}'; if the drive is of that kind, write the kind "
        "and its gains into the actuator's file"
    )
    return (reason,)


def with_drive(actuator: Actuator, kind: str) -> Actuator:
    """Return the actuator with a drive of another `kind` for the same motor, with usual values."""
    values: dict[str, Any] = actuator.model_dump(exclude_none=True)
    electrical, drive = values["electrical"], values.get("drive", {}) | {"kind": kind}
    bandwidth = 2 * math.pi * USUAL_BANDWIDTH_HZ
    if kind == "six-step":
        drive |= {
            "current_gain": bandwidth * electrical["inductance"],
            "current_integral_gain": bandwidth * electrical["resistance"],
            "pwm_frequency": USUAL_PWM_HZ,
        }
    electrical.setdefault("hysteresis", USUAL_HYSTERESIS * values["controller"]["current_limit"])
    return Actuator.from_dict(values | {"drive": drive}, where=actuator.name)


def _gains_as_text(rival: SearchResult, gains: tuple[str, ...]) -> str:
    """Return the estimated gains as text."""
    described = lumped_parameters(rival.objective.problem.actuator, gains)
    deviations = rival.objective.space.nuisance_values(rival.point[np.newaxis])
    values = [
        f"{name} {described[name] * math.exp(deviations[BASELINE + name].item()):.3g}" for name in gains
    ]
    return ", ".join(values)
