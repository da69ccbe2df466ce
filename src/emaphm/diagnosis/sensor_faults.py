"""Faults of sensors: from checks of the signals without a model, and from errors estimated with the model."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from emaphm.actuator import NAMES, Actuator
from emaphm.actuator.columns.units import in_unit
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.estimation.compared_channels import TORQUE_CURRENTS
from emaphm.estimation.sensors.sensor_model import SENSOR_CHANNELS, sensor_error
from emaphm.estimation.space.nuisances import usual_deviation
from emaphm.estimation.uncertainty.collinearity import CollinearSet
from emaphm.recording.sensor_checks import SensorFinding

REVERSED = 0.2
"""Largest deviation of a scale factor from -1 up to which a sensor is called reversed."""

CERTAIN = 3.0
"""Smallest distance of an estimated sensor error from zero, in standard errors, to be called a fault."""

LIKE_A_SPEED_SCALE = (
    " A wrong scale of the position sensor in the drive's control loop, or another gear ratio, would have "
    "the same effect."
)
"""With these, the recorded position follows the command correctly, and the speed is inconsistent with it."""

LIKE_A_HELD_SHAFT = (
    " A shaft that friction held away from the command at the start of the recording would have the same "
    "effect."
)
"""Added if neither a position nor a rest before the motion was recorded."""

LIKE_A_CURRENT_SCALE = (
    " A torque constant of {factor:.3g} times the described value would have the same effect."
)
"""Added if the actuator has no electrical description: a current then acts through its torque alone."""

SPEED_UNITS = ("rpm", "deg/s", "turns/s")
"""Units of a speed other than rad/s: a column in one of them seems to have a wrong scale."""

LIKE_A_UNIT = 0.02
"""Largest relative deviation of a scale factor from that of a unit up to which the unit is named."""

LIKE_ANOTHER_UNIT = " A speed in {unit} has this factor: check its unit under [channels]."

UNFOLLOWED = "does not follow its quantity: its scale of {factor:.2g} may be 0"
"""Meaning of a scale factor within `CERTAIN` standard errors of 0."""

MEANINGS = {
    "bias": "shows {size:.3g} {unit} at zero",
    "scale": "shows {factor:.4g} times its quantity",
    "reversed": "is reversed: it shows {factor:.4g} times its quantity",
    "drift": "drifts by {size:.3g} {unit} over the recording",
    "delay": "{late} by {milliseconds:.3g} ms",
}


@dataclass(frozen=True)
class SensorFault:
    """One fault of a sensor.

    Attributes
    ----------
    channel
        The column; several columns are joined by " and "; "all channels" for a common delay.
    kind
        "bias", "scale", "reversed", "drift", "delay", "frozen", "held", "clipped", "swapped"
        or "noise".
    size, unit
        Bias, drift: in the channel's unit. Scale: relative error. Delay [s], positive if the channel is
        late. Frozen: duration [s]; held: number of rows; clipped: the level; swapped: number of channels.
    standard_error
        Standard error of the size; None if it was not estimated.
    sentence
        Description of the fault, its size, and other causes with the same effect.
    """

    channel: str
    kind: str
    size: float
    unit: str
    standard_error: float | None
    sentence: str

    def __str__(self) -> str:
        return self.sentence

    def to_dict(self) -> dict[str, Any]:
        """Return the fault's entry in the JSON of a diagnosis."""
        return asdict(self)


def sensor_faults(
    findings: Sequence[SensorFinding],
    selected: Sequence[str],
    nuisances: Mapping[str, NuisanceEstimate],
    collinear_sets: Sequence[CollinearSet],
    channels: Sequence[str],
    actuator: Actuator,
    *,
    explained: bool,
) -> tuple[SensorFault, ...]:
    """Return the faults of sensors.

    A significant delay is a fault; a significant zero error, scale or drift is a fault if it is larger than
    the standard deviation of its prior, which the `actuator` states.

    Parameters
    ----------
    findings
        Sensor faults found by checks without a model.
    selected
        Nuisances that deviate significantly, in this recording or in other recordings of a joint diagnosis.
        Errors of sensors among them count if they were estimated for this recording and it is `explained`:
        the cause of an unexplained residual is unknown.
    nuisances, collinear_sets, channels
        As in `Diagnosis`.
    """
    faults = [SensorFault(f.channel, f.kind, f.size, f.unit, None, f"{f.sentence}.") for f in findings]
    if explained:
        errors = {
            name: error
            for name in selected
            if name in nuisances and (error := sensor_error(name)) is not None
        }
        for name, error in errors.items():
            size = abs(nuisances[name].value)
            if size <= CERTAIN * nuisances[name].standard_error:
                continue
            if error[1] == "delay" or size > usual_deviation(actuator, name):
                fault = _estimated_fault(name, *error, nuisances[name], collinear_sets, channels)
                fault = _with_torque_constant(fault) if actuator.electrical is None else fault
                faults.append(fault if actuator.has_linear_motor else _with_unit(fault))
    return tuple(faults)


def _with_torque_constant(fault: SensorFault) -> SensorFault:
    """Return the fault, with a wrong torque constant as another possible cause of a current's scale."""
    if not (fault.channel in TORQUE_CURRENTS and fault.kind == "scale"):
        return fault
    alike = LIKE_A_CURRENT_SCALE.format(factor=1 / (1 + fault.size))
    return replace(fault, sentence=f"{fault.sentence}{alike}")


def _with_unit(fault: SensorFault) -> SensorFault:
    """Return the fault, with the unit that a wrong scale of a speed indicates."""
    if (fault.channel, fault.kind) != ("speed_rad_s", "scale"):
        return fault
    for unit in SPEED_UNITS:
        factor = float(in_unit(np.ones(1), "rad/s", unit)[0])
        if abs((1 + fault.size) / factor - 1) < LIKE_A_UNIT:
            return replace(fault, sentence=f"{fault.sentence}{LIKE_ANOTHER_UNIT.format(unit=unit)}")
    return fault


def _estimated_fault(
    name: str,
    quantity: str,
    error: str,
    estimate: NuisanceEstimate,
    collinear_sets: Sequence[CollinearSet],
    channels: Sequence[str],
) -> SensorFault:
    """Return the sensor fault that was estimated as nuisance `name`."""
    kind = "bias" if error == "offset" else error
    if kind == "scale" and abs(estimate.value + 2) < REVERSED:
        kind = "reversed"
    channel = "all channels"
    if quantity != "all":
        channel = next(column for column in SENSOR_CHANNELS[quantity] if column in channels)
    follows = abs(1 + estimate.value) > CERTAIN * estimate.standard_error
    meaning = (MEANINGS[kind] if follows or kind != "scale" else UNFOLLOWED).format(
        size=estimate.value,
        unit=estimate.unit,
        factor=1 + estimate.value,
        milliseconds=1e3 * abs(estimate.value),
        late="come late" if quantity == "all" else "comes late" if estimate.value > 0 else "comes early",
    )
    if quantity == "all" and estimate.value < 0:
        meaning = meaning.replace("come late", "come early")
    error_text = np.format_float_positional(estimate.standard_error, 2, fractional=False, trim="-")
    digits = f" (± {error_text} {estimate.unit})".replace(" -)", ")")
    collinear = [
        member
        for group in collinear_sets
        if name in group.members
        for member in group.members
        if member != name
    ]
    actuator_faults = [member for member in collinear if member in NAMES]
    sentence = f"The sensor of {channel} {meaning}{digits}."
    if quantity == "all":
        sentence = f"All channels {meaning} against the command{digits}."
    if (channel, kind) == ("speed_rad_s", "scale") and "position_rad" in channels:
        sentence += LIKE_A_SPEED_SCALE
    if channel in TORQUE_CURRENTS and kind == "bias" and "position_rad" not in channels:
        sentence += LIKE_A_HELD_SHAFT
    if collinear:
        cause = "an actuator fault" if actuator_faults else "another deviation"
        sentence += f" This recording does not distinguish it from {cause}: {', '.join(collinear)}."
    return SensorFault(channel, kind, estimate.value, estimate.unit, estimate.standard_error, sentence)
