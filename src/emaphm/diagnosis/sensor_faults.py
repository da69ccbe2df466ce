"""Faults of the sensors: what their signals show by themselves, and what the model shows of them."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from emaphm.actuator import NAMES, Actuator
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.estimation.compared_channels import TORQUE_CURRENTS
from emaphm.estimation.sensors.sensor_model import SENSOR_CHANNELS, sensor_error
from emaphm.estimation.space.nuisances import usual_deviation
from emaphm.estimation.uncertainty.collinearity import CollinearSet
from emaphm.recording.sensor_checks import SensorFinding

REVERSED = 0.2
"""Largest deviation of a factor from -1 that is called a reversed sensor: a reversal has no size."""

CERTAIN = 3.0
"""Standard errors that an estimated error of a sensor is off zero at least to be called a fault."""

LIKE_A_SPEED_SCALE = (
    " A position sensor of another scale that the drive controls by, or another gear ratio, looks alike."
)
"""The recorded position then follows the command as it should, and the speed does not go with it."""

LIKE_A_HELD_SHAFT = " A shaft that friction held off the command as the recording began looks alike."
"""Where no position shows where it stood, and no rest before the motion was recorded."""

LIKE_A_CURRENT_SCALE = " A torque constant that is {factor:.3g} times the described one looks alike."
"""Without windings, nothing but the torque of the current shows."""

UNFOLLOWED = "does not follow its quantity: its scale of {factor:.2g} may be 0"
"""A scale that is no more than `CERTAIN` standard errors from 0 has no size worth a name."""

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
        The column; several with " and " between them, "all channels" for a delay that they share.
    kind
        "bias", "scale", "reversed", "drift", "delay", "frozen", "held", "clipped" or "swapped".
    size, unit
        Bias, drift: in the channel's unit. Scale: relative error. Delay [s], above 0 where the channel is
        late. Frozen [s], held [rows], clipped: the level. Swapped: how many channels.
    standard_error
        Of the size, None where it was not estimated.
    sentence
        What is wrong, how much, and what it may be mistaken for.
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
        """Return the fault as the JSON of a diagnosis has it."""
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

    A delay that was estimated is a fault; a zero, scale or drift where it is larger than what the `actuator`
    says is usual of its sensors.

    Parameters
    ----------
    findings
        Of the checks without a model.
    selected
        Nuisances that deviate significantly, of this recording or of others of a joint diagnosis; those of
        this one that are errors of sensors count, if the recording is `explained`: what causes a residual
        that stays is not known.
    nuisances, collinear_sets, channels
        As in `Diagnosis`.
    """
    found = [SensorFault(f.channel, f.kind, f.size, f.unit, None, f"{f.sentence}.") for f in findings]
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
                fault = _estimated(name, *error, nuisances[name], collinear_sets, channels)
                found.append(_with_torque_constant(fault) if actuator.electrical is None else fault)
    return tuple(found)


def _with_torque_constant(fault: SensorFault) -> SensorFault:
    """Return a fault of an actuator without windings with what else it may be."""
    if not (fault.channel in TORQUE_CURRENTS and fault.kind == "scale"):
        return fault
    alike = LIKE_A_CURRENT_SCALE.format(factor=1 / (1 + fault.size))
    return replace(fault, sentence=f"{fault.sentence}{alike}")


def _estimated(
    name: str,
    quantity: str,
    error: str,
    estimate: NuisanceEstimate,
    collinear_sets: Sequence[CollinearSet],
    channels: Sequence[str],
) -> SensorFault:
    """Return the fault of a sensor that was estimated as nuisance `name`."""
    kind = "bias" if error == "offset" else error
    if kind == "scale" and abs(estimate.value + 2) < REVERSED:
        kind = "reversed"
    channel = "all channels"
    if quantity != "all":
        channel = next(one for one in SENSOR_CHANNELS[quantity] if one in channels)
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
    spread = np.format_float_positional(estimate.standard_error, 2, fractional=False, trim="-")
    digits = f" (± {spread} {estimate.unit})".replace(" -)", ")")
    others = [
        other for one in collinear_sets if name in one.members for other in one.members if other != name
    ]
    faults = [other for other in others if other in NAMES]
    sentence = f"The sensor of {channel} {meaning}{digits}."
    if quantity == "all":
        sentence = f"All channels {meaning} against the command{digits}."
    if (channel, kind) == ("speed_rad_s", "scale") and "position_rad" in channels:
        sentence += LIKE_A_SPEED_SCALE
    if channel in TORQUE_CURRENTS and kind == "bias" and "position_rad" not in channels:
        sentence += LIKE_A_HELD_SHAFT
    if others:
        what = "an actuator fault" if faults else "another deviation"
        sentence += f" This recording does not tell it from {what}: {', '.join(others)}."
    return SensorFault(channel, kind, estimate.value, estimate.unit, estimate.standard_error, sentence)
