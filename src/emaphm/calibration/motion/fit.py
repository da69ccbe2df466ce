"""A campaign by measured motion: inverse dynamics of its recordings, as a result or as a start of the fit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import LUMPED_PARAMETERS, lumped_parameters
from emaphm.actuator.unit.baseline import SECTIONS, SIGNED
from emaphm.arrays import Array
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.conditions import SAME_PARAMETER
from emaphm.errors import ActuatorError, MethodError, RecordingError
from emaphm.estimation.inverse_dynamics import InverseDynamicsResult, inverse_dynamics
from emaphm.estimation.inverse_dynamics.torque_balance import NAMES
from emaphm.estimation.space.nuisances import KNOWN_BY, MAGNETS, NO_NUISANCES
from emaphm.estimation.space.parameter_variation import sizes
from emaphm.recording import Recording

LOADS = ("load", "hinge")
"""Nuisances that inverse dynamics estimates of each recording; the others it leaves out."""

OF_CONTROLLER = SECTIONS["controller"]
"""Parameters that measured motion does not depend on, so that known values of them may be left out."""

BALANCED = (*NAMES, *(name for name in LUMPED_PARAMETERS if name.startswith("ripple")))
"""The parameters that inverse dynamics knows."""


@dataclass(frozen=True, eq=False)
class MotionFit:
    """Inverse dynamics of all rows: what it `found`, and its covariance with what its low-passes change.

    `loads` are the nuisances that were estimated of each row. `covariance` (p, p) is that of the shared
    parameters, in their order and units. `alone` is the same of each row by itself, where there are several;
    None of one that does not show all parameters. `scale_deviation` is the standard deviation, relative, of
    what is not known of the recordings' torque in proportion to their current.
    """

    found: InverseDynamicsResult
    loads: tuple[tuple[str, ...], ...]
    covariance: Array
    scale_deviation: float
    alone: tuple["MotionFit | None", ...] = ()


@dataclass(frozen=True, eq=False)
class _Campaign:
    """Rows as inverse dynamics takes them: with one set of parameters that are each recording's own."""

    recordings: tuple[Recording, ...]
    shared: tuple[str, ...]
    own: tuple[str, ...]
    known: tuple[Mapping[str, float], ...]
    loads: tuple[tuple[str, ...], ...]

    @classmethod
    def of(
        cls,
        rows: Sequence[CampaignRow],
        actuator: Actuator,
        free: Sequence[str],
        nuisances: Sequence[str] | None,
    ) -> Self:
        """Return the campaign with the parameters `free`, those that inverse dynamics knows."""
        shared = tuple(name for name in free if name in BALANCED)
        asked = actuator.nuisances.estimated if nuisances is None else nuisances
        loads = tuple(_loads(row, shared, asked) for row in rows)
        freed = [
            {*(SAME_PARAMETER[name] for name in of_row), *(set(row.free) & set(BALANCED) - set(shared))}
            for row, of_row in zip(rows, loads, strict=True)
        ]
        own = tuple(dict.fromkeys(name for of_row in freed for name in sorted(of_row)))
        described = lumped_parameters(actuator, own)
        known = tuple(
            _of_temperature(row, actuator, (*shared, *of_row))
            | {name: value for name, value in described.items() if name not in of_row}
            | {name: v for name, v in row.parameters.items() if name not in (*OF_CONTROLLER, "supply")}
            for row, of_row in zip(rows, freed, strict=True)
        )
        return cls(tuple(_recording(row) for row in rows), shared, own, known, loads)

    def fit(self, actuator: Actuator, cutoff_hz: tuple[float, float] | None = None) -> InverseDynamicsResult:
        """Return the result of inverse dynamics, errors as there."""
        position_hz, regression_hz = cutoff_hz or (None, None)
        return inverse_dynamics(
            self.recordings,
            actuator,
            (*self.shared, *self.own),
            known=self.known,
            per_recording=self.own,
            position_hz=position_hz,
            regression_hz=regression_hz,
        )


def _loads(row: CampaignRow, shared: Sequence[str], asked: Sequence[str]) -> tuple[str, ...]:
    """Return the unknown loads of a row: none that is known, recorded or a free parameter."""
    # In motion a constant load and unequal Coulomb friction are the same.
    alike = {"load": ("offset", "coulomb_asymmetry"), "hinge": ("hinge",)}
    taken = {*shared, *row.free, *row.known}
    return tuple(
        name
        for name in LOADS
        if name in asked
        and name not in taken
        and not taken & set(alike[name])
        and KNOWN_BY[name] not in row.recording
    )


def _of_temperature(row: CampaignRow, actuator: Actuator, free: Sequence[str]) -> dict[str, float]:
    """Return the torque constant and the resistance at a row's known temperature, those not `free`."""
    recording = row.completed()
    if actuator.electrical is None or KNOWN_BY["temperature"] not in recording:
        return {}
    rise = float(np.mean(recording[KNOWN_BY["temperature"]])) - actuator.electrical.temperature
    warm = NO_NUISANCES.lumped_parameters(actuator, {}, rise) if rise else {}
    return {name: float(value) for name, value in warm.items() if name in BALANCED and name not in free}


def _recording(row: CampaignRow) -> Recording:
    """Return a row's recording with channels of what is known of it."""
    recording = row.completed()
    if "supply" not in row.known or "supply_V" in recording:
        return recording
    supply = {"supply_V": np.full(recording.samples, row.known["supply"])}
    return Recording({**recording.channels, **supply}, recording.sampling, recording.source, recording.notes)


def check_measurable(rows: Sequence[CampaignRow], free: Sequence[str]) -> None:
    """Refuse free parameters that measured motion does not show.

    Raises
    ------
    MethodError
        One is not in the torque balance, or is shared and a recording's own at once.
    """
    own = {name for row in rows for name in row.free}
    for name in (*free, *sorted(own)):
        if name not in BALANCED:
            raise MethodError(
                f"measured motion does not show '{name}'; leave it out, or calibrate in closed loop (loop "
                f"'closed'). It shows {', '.join(NAMES)}, and torque ripple"
            )
    for name in sorted(own & set(free)):
        raise MethodError(
            f"'{name}' is shared and a recording's own at once, which measured motion cannot weigh; leave "
            "one out, or calibrate in closed loop (loop 'closed')"
        )


def motion_fit(
    rows: Sequence[CampaignRow],
    actuator: Actuator,
    free: tuple[str, ...],
    nuisances: Sequence[str] | None,
) -> MotionFit:
    """Return the parameters `free` by the measured motion of all `rows`; errors as `inverse_dynamics`.

    The estimate is repeated with half the cutoff frequencies: what that changes is added to the covariance
    as one more standard error, in quadrature.
    """
    campaign = _Campaign.of(rows, actuator, free, nuisances)
    found = campaign.fit(actuator)
    used = [one.frequencies for one in found.replays]
    lower = (min(one.position_hz for one in used) / 2, min(one.regression_hz for one in used) / 2)
    again = campaign.fit(actuator, lower)
    change = np.array([again.values[name] - value for name, value in found.values.items()])
    alone = tuple(_alone(row, actuator, free, nuisances) for row in rows) if len(rows) > 1 else ()
    return MotionFit(
        found,
        campaign.loads,
        found.covariance + np.outer(change, change),
        _scale_deviation(rows, actuator, free, nuisances),
        alone,
    )


def _scale_deviation(
    rows: Sequence[CampaignRow], actuator: Actuator, free: Sequence[str], nuisances: Sequence[str] | None
) -> float:
    """Return the relative standard deviation of all torques together: by heat of magnets and by the sensor.

    A free torque constant has it in its own standard error.
    """
    if "torque_constant" in free:
        return 0.0
    priors, variance = actuator.nuisances, 0.0
    asked = priors.estimated if nuisances is None else nuisances
    cold = [row for row in rows if KNOWN_BY["temperature"] not in row.completed()]
    if "temperature" in asked and cold and actuator.electrical is not None:
        variance += (MAGNETS * priors.temperature) ** 2
    if "current_scale" in asked and priors.current_scale is not None:
        variance += priors.current_scale**2
    return float(variance**0.5)


def _alone(
    row: CampaignRow, actuator: Actuator, free: tuple[str, ...], nuisances: Sequence[str] | None
) -> MotionFit | None:
    try:
        return motion_fit((row,), actuator, free, nuisances)
    except (MethodError, RecordingError):
        return None


def measured_start(
    rows: Sequence[CampaignRow],
    actuator: Actuator,
    fitted: tuple[str, ...],
    nuisances: Sequence[str] | None,
) -> dict[str, float]:
    """Return coordinates to start a closed-loop fit from; none where the recordings do not do for it."""
    if not set(fitted) & set(BALANCED):
        return {}
    try:
        values = _Campaign.of(rows, actuator, fitted, nuisances).fit(actuator).values
    except (MethodError, ActuatorError, RecordingError):
        return {}
    return coordinates(actuator, values)


def coordinates(actuator: Actuator, values: Mapping[str, float]) -> dict[str, float]:
    """Return the deviations of `values` from the description, in a fit's coordinates.

    A value without the sign that it must have has none.
    """
    described, names = lumped_parameters(actuator, tuple(values)), tuple(values)
    found = {}
    for name, size in zip(names, sizes(actuator, names), strict=True):
        if name in SIGNED:
            found[name] = float((values[name] - described[name]) / size)
        elif values[name] > 0 and described[name] > 0:
            found[name] = float(np.log(values[name] / described[name]))
    return found
