"""Inverse dynamics of a campaign from its measured motion, as a result or as start of a closed-loop fit."""

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
"""Nuisances that inverse dynamics estimates for each recording; it does not use other nuisances."""

OF_CONTROLLER = SECTIONS["controller"]
"""Parameters of the controller; inverse dynamics does not depend on them and ignores their known values."""

BALANCED = (*NAMES, *(name for name in LUMPED_PARAMETERS if name.startswith("ripple")))
"""Parameters of the torque balance, which inverse dynamics can estimate."""


@dataclass(frozen=True, eq=False)
class MotionFit:
    """Inverse dynamics of all rows: its result `found`, and the covariance including the effect of filters.

    `loads` are the estimated nuisances of each row. `covariance` (p, p) is that of the shared parameters, in
    their order and units. `alone` are the fits of each row alone, if there are several rows; None for a row
    that does not identify all parameters. `scale_deviation` is the relative standard deviation of the
    common, unknown factor between torque and recorded current.
    """

    found: InverseDynamicsResult
    loads: tuple[tuple[str, ...], ...]
    covariance: Array
    scale_deviation: float
    alone: tuple["MotionFit | None", ...] = ()


@dataclass(frozen=True, eq=False)
class _Campaign:
    """Rows in the form of inverse dynamics: all recordings have the same set of own parameters."""

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
        """Return the campaign with those of the parameters `free` that are in the torque balance."""
        shared = tuple(name for name in free if name in BALANCED)
        estimated = actuator.nuisances.estimated if nuisances is None else nuisances
        loads = tuple(_loads(row, shared, estimated) for row in rows)
        freed = [
            {*(SAME_PARAMETER[name] for name in of_row), *(set(row.free) & set(BALANCED) - set(shared))}
            for row, of_row in zip(rows, loads, strict=True)
        ]
        own = tuple(dict.fromkeys(name for of_row in freed for name in sorted(of_row)))
        described = lumped_parameters(actuator, own)
        known = tuple(
            _warm_parameters(row, actuator, (*shared, *of_row))
            | {name: value for name, value in described.items() if name not in of_row}
            | {name: v for name, v in row.parameters.items() if name not in (*OF_CONTROLLER, "supply")}
            for row, of_row in zip(rows, freed, strict=True)
        )
        return cls(tuple(_recording(row) for row in rows), shared, own, known, loads)

    def fit(self, actuator: Actuator, cutoff_hz: tuple[float, float] | None = None) -> InverseDynamicsResult:
        """Return the result of `inverse_dynamics`; raises the same errors."""
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


def _loads(row: CampaignRow, shared: Sequence[str], estimated: Sequence[str]) -> tuple[str, ...]:
    """Return the unknown loads of a row: `estimated`, and neither known, recorded nor a free parameter."""
    # In motion, a constant load and asymmetric Coulomb friction have the same effect.
    confounded = {"load": ("offset", "coulomb_asymmetry"), "hinge": ("hinge",)}
    settled = {*shared, *row.free, *row.known}
    return tuple(
        name
        for name in LOADS
        if name in estimated
        and name not in settled
        and not settled & set(confounded[name])
        and KNOWN_BY[name] not in row.recording
    )


def _warm_parameters(row: CampaignRow, actuator: Actuator, free: Sequence[str]) -> dict[str, float]:
    """Return torque constant and resistance at the known temperature of a row, except if `free`."""
    recording = row.completed()
    if actuator.electrical is None or KNOWN_BY["temperature"] not in recording:
        return {}
    rise = float(np.mean(recording[KNOWN_BY["temperature"]])) - actuator.electrical.temperature
    warm = NO_NUISANCES.lumped_parameters(actuator, {}, rise) if rise else {}
    return {name: float(value) for name, value in warm.items() if name in BALANCED and name not in free}


def _recording(row: CampaignRow) -> Recording:
    """Return the recording of a row with channels of its known load, temperature and supply."""
    recording = row.completed()
    if "supply" not in row.known or "supply_V" in recording:
        return recording
    supply = {"supply_V": np.full(recording.samples, row.known["supply"])}
    return Recording({**recording.channels, **supply}, recording.sampling, recording.source, recording.notes)


def check_measurable(rows: Sequence[CampaignRow], free: Sequence[str]) -> None:
    """Check that measured motion can identify the free parameters.

    Raises
    ------
    MethodError
        A parameter is not in the torque balance, or is both shared and a recording's own.
    """
    own = {name for row in rows for name in row.free}
    for name in (*free, *sorted(own)):
        if name not in BALANCED:
            raise MethodError(
                f"measured motion does not identify '{name}'; leave it out, or calibrate in closed loop "
                f"(loop 'closed'). It identifies {', '.join(NAMES)}, and torque ripple"
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
    """Return the estimates of `free` from the measured motion of all `rows`.

    The estimate is repeated with half the cutoff frequencies; the change is added to the covariance as an
    additional standard error, in quadrature. Raises the errors of `inverse_dynamics`.
    """
    campaign = _Campaign.of(rows, actuator, free, nuisances)
    result = campaign.fit(actuator)
    used = [replay.frequencies for replay in result.replays]
    lower = (min(cutoff.position_hz for cutoff in used) / 2, min(cutoff.regression_hz for cutoff in used) / 2)
    filtered_more = campaign.fit(actuator, lower)
    change = np.array([filtered_more.values[name] - value for name, value in result.values.items()])
    alone = tuple(_fit_alone(row, actuator, free, nuisances) for row in rows) if len(rows) > 1 else ()
    return MotionFit(
        result,
        campaign.loads,
        result.covariance + np.outer(change, change),
        _scale_deviation(rows, actuator, free, nuisances),
        alone,
    )


def _scale_deviation(
    rows: Sequence[CampaignRow], actuator: Actuator, free: Sequence[str], nuisances: Sequence[str] | None
) -> float:
    """Return the relative standard deviation of a common factor of all torques.

    It is due to the temperature of the magnets and the scale of the current sensor. It is 0 for a free torque
    constant, whose own standard error includes it.
    """
    if "torque_constant" in free:
        return 0.0
    priors, variance = actuator.nuisances, 0.0
    estimated = priors.estimated if nuisances is None else nuisances
    cold = [row for row in rows if KNOWN_BY["temperature"] not in row.completed()]
    if "temperature" in estimated and cold and actuator.electrical is not None:
        variance += (MAGNETS * priors.temperature) ** 2
    if "current_scale" in estimated and priors.current_scale is not None:
        variance += priors.current_scale**2
    return float(variance**0.5)


def _fit_alone(
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
    """Return start coordinates for a closed-loop fit; empty if inverse dynamics of the rows is impossible."""
    if not set(fitted) & set(BALANCED):
        return {}
    try:
        values = _Campaign.of(rows, actuator, fitted, nuisances).fit(actuator).values
    except (MethodError, ActuatorError, RecordingError):
        return {}
    return coordinates(actuator, values)


def coordinates(actuator: Actuator, values: Mapping[str, float]) -> dict[str, float]:
    """Return the deviations of `values` from the description, in a fit's coordinates.

    A value that is not positive although it must be is left out.
    """
    described, names = lumped_parameters(actuator, tuple(values)), tuple(values)
    deviations = {}
    for name, size in zip(names, sizes(actuator, names), strict=True):
        if name in SIGNED:
            deviations[name] = float((values[name] - described[name]) / size)
        elif values[name] > 0 and described[name] > 0:
            deviations[name] = float(np.log(values[name] / described[name]))
    return deviations
