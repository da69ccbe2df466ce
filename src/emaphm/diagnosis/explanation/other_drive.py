"""Whether a drive of another kind than the described one explains a recording.

A brushless motor's current is controlled by comparators or by a PI controller with pulse-width modulation,
and a data sheet of the motor does not say which. The current of the one lags where that of the other does
not, which no law and no fault makes up for.
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
"""For a drive of one kind, that which turns the same motor."""

GAINS = {"hysteresis": SPEED_LOOP, "six-step": (*SPEED_LOOP, *CURRENT_CONTROL)}
"""What is estimated with the faults, by kind: the speed loop is tuned to the current's."""

USUAL_BANDWIDTH_HZ, USUAL_PWM_HZ, WITHIN = 400.0, 2e4, 0.7
"""Of a current control by PI, and the standard deviation of the gains' logarithms: they are sought within a
factor of 16 either way."""

MOST_LEFT = {True: 0.8, False: 0.25}
"""Share of the mean squared residual that the drive of another kind may leave: where it explains the
recording, and where it does not, since its modulation may have another frequency."""

USUAL_HYSTERESIS = 0.02
"""Of comparators, a share of the current limit."""


def other_drive(searched: SearchResult, found: SearchResult, settings: SearchSettings) -> tuple[str, ...]:
    """Return that a drive of another kind would explain far more of the recording; nothing if none does.

    Than `found`, with all that deviates, from the estimate `searched` by the description.
    """
    objective = searched.objective
    kind = OTHER_KINDS.get(objective.problem.actuator.drive_kind)
    if kind is None:
        return ()
    actuator = with_drive(objective.problem.actuator, kind)
    known = objective.space.nuisances.parameters
    gains = tuple(name for name in GAINS[kind] if name not in known)
    opened = ParameterVariation.free(actuator, gains).known_to(dict.fromkeys(gains, WITHIN))
    child = settings.child("another kind of drive")
    try:
        rival = search(
            with_open(objective, actuator, opened),
            child,
            fitness="least_squares",
            is_hopeless=lambda rival: share_of_residual(rival, found) > MOST_LEFT[True],
        )
    except DivergedError:
        return ()
    share = share_of_residual(rival, found)
    if share > MOST_LEFT[rival.residual_is_expected]:
        return ()
    present = objective.problem.actuator.drive_kind
    reason = (
        f"a drive of kind '{kind}', with {_in_words(rival, gains)}, leaves {100 * share:.2g} % of the mean "
        f"squared residual of the described one of kind '{present}'; if the drive is one, write that kind "
        "and its gains into the actuator's file"
    )
    return (reason,)


def with_drive(actuator: Actuator, kind: str) -> Actuator:
    """Return the actuator with a drive of another `kind` of the same motor, at usual values."""
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


def _in_words(rival: SearchResult, gains: tuple[str, ...]) -> str:
    """Return the gains that were estimated."""
    described = lumped_parameters(rival.objective.problem.actuator, gains)
    deviations = rival.objective.space.nuisance_values(rival.point[np.newaxis])
    values = [
        f"{name} {described[name] * math.exp(deviations[BASELINE + name].item()):.3g}" for name in gains
    ]
    return ", ".join(values)
