"""Error of the calibrated model of a healthy unit in each channel, learned in the calibration."""

from typing import Self

from pydantic import Field, model_validator

from emaphm.actuator.quantity import quantity
from emaphm.actuator.requirements import component_of
from emaphm.actuator.section import Section
from emaphm.actuator.sensors import OF_THE_CHANNEL

LEARNED = "calibration: recordings left out of the fit"

APPARENT = "apparent fault of a healthy unit, rms"


class ChannelError(Section):
    """Error of a calibrated model in a channel of healthy recordings, in addition to white noise.

    It is learned from the residuals of recordings that were left out of the fit, one at a time, with only the
    recording's nuisances estimated: residuals of the training would be too small. The error of a row is
    normal about 0, with the variance

        σ²(t) = floor² + (speed ω)² + (load τ)² + (acceleration α)²

    with the healthy model's motor speed ω [rad/s], load τ [N·m] and acceleration α [rad/s²]. Errors are
    correlated: the variance of any weighted sum of the errors of rows at an interval Δt is at most
    `correlation_time` / Δt times the variance for independent errors.

    Source: Kennedy and O'Hagan (2001), a discrepancy between model and reality that is learned together with
    the parameters; here without its mean, because the calibrated parameters contain the common part of few
    recordings.
    """

    floor: float = quantity("rms at rest, without load", OF_THE_CHANNEL, LEARNED, ge=0)
    speed: float = quantity("rms per motor speed", f"{OF_THE_CHANNEL} / (rad/s)", LEARNED, default=0.0, ge=0)
    load: float = quantity(
        "rms per load at the motor", f"{OF_THE_CHANNEL} / (N·m)", LEARNED, default=0.0, ge=0
    )
    acceleration: float = quantity(
        "rms per acceleration of the motor", f"{OF_THE_CHANNEL} / (rad/s²)", LEARNED, default=0.0, ge=0
    )
    noise: float | None = quantity(
        "white noise of a healthy recording's rows, rms; of any size where left out",
        OF_THE_CHANNEL,
        LEARNED,
        default=None,
        ge=0,
    )
    correlation_time: float = quantity(
        "largest integral time: peak of the spectrum over the variance", "s", LEARNED, gt=0
    )
    scatter: float = quantity(
        "standard deviation, between recordings, of the logarithm of their rms over the expected one",
        "-",
        LEARNED,
        ge=0,
    )
    recordings: int = Field(description="recordings that were left out in turn", ge=2)

    @model_validator(mode="after")
    def _check_not_zero(self) -> Self:
        if not any((self.floor, self.speed, self.load, self.acceleration)):
            raise ValueError(
                "an error of 0 everywhere is no error; leave the channel's section out, or give floor > 0"
            )
        return self


class ApparentFaults(Section):
    """Apparent faults that a diagnosis estimates from healthy recordings left out of the calibration.

    For each component, the rms over `recordings` of the estimate minus the healthy value, beyond its standard
    error. It is an error of the model that is confounded with a fault, and therefore not visible in the
    residual.
    """

    friction: float = quantity(APPARENT, "-", LEARNED, default=0.0, ge=0, le=1)
    backlash: float = quantity(APPARENT, "-", LEARNED, default=0.0, ge=0, le=1)
    short_a: float = quantity(APPARENT, "-", LEARNED, default=0.0, ge=0, le=1)
    short_b: float = quantity(APPARENT, "-", LEARNED, default=0.0, ge=0, le=1)
    short_c: float = quantity(APPARENT, "-", LEARNED, default=0.0, ge=0, le=1)
    eccentricity: float = quantity(
        "apparent fault of a healthy unit, rms", "-", LEARNED, default=0.0, ge=0, le=1
    )
    gain: float = quantity(APPARENT, "-", LEARNED, default=0.0, ge=0, le=1)
    recordings: int = Field(description="recordings that were left out and diagnosed", ge=2)

    def of(self, coordinate: str) -> float:
        """Return the apparent fault of an estimator coordinate; both of the eccentricity have the same."""
        name = component_of(coordinate)
        return float(getattr(self, name, 0.0)) if name in ApparentFaults.model_fields else 0.0


class ModelError(Section):
    """The error of the model in each channel that a diagnosis may compare, None if it was not learned.

    `faults` are the apparent faults, the part of the error that is confounded with faults.
    """

    faults: ApparentFaults | None = None
    position_rad: ChannelError | None = None
    speed_rad_s: ChannelError | None = None
    angle_rad: ChannelError | None = None
    current_a_A: ChannelError | None = None
    current_b_A: ChannelError | None = None
    current_c_A: ChannelError | None = None
    current_A: ChannelError | None = None
    current_d_A: ChannelError | None = None
    current_q_A: ChannelError | None = None
    voltage_V: ChannelError | None = None
    voltage_d_V: ChannelError | None = None
    voltage_q_V: ChannelError | None = None
    duty: ChannelError | None = None

    def of(self, channel: str) -> ChannelError | None:
        """Return the learned error of a channel, None if none was learned."""
        return getattr(self, channel) if channel in CHANNELS else None


CHANNELS = tuple(name for name in ModelError.model_fields if name != "faults")
"""Channels whose error can be learned."""

NOT_LEARNED = ModelError()
"""Model error of an actuator that is not calibrated, or calibrated from a single recording."""
