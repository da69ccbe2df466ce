"""`[sensors]`: errors of the sensors of a rig."""

from pydantic import Field

from emaphm.actuator.quantity import quantity
from emaphm.actuator.section import Section

OF_THE_CHANNEL = "unit of the channel"

DATA_SHEET = "data sheet of the sensor"


class Sensor(Section):
    """Errors of a sensor: lag, delay, errors of scale and zero, noise and limited resolution.

    The sensor is outside the control loop: the drive uses the true value. The equations are in
    `emaphm.simulation.laws.sensors`.
    """

    lag: float = quantity("time constant", "s", DATA_SHEET, default=0.0, ge=0)
    delay: float = quantity("pure delay", "s", DATA_SHEET, default=0.0, ge=0)
    scale: float = quantity(
        "relative error of the scale: factor 1 + scale", "-", DATA_SHEET, default=0.0, gt=-1
    )
    offset: float = quantity("what it shows at 0", OF_THE_CHANNEL, DATA_SHEET, default=0.0)
    noise: float = quantity("white noise of a row, rms", OF_THE_CHANNEL, DATA_SHEET, default=0.0, ge=0)
    resolution: float = quantity("step of a count", OF_THE_CHANNEL, DATA_SHEET, default=0.0, ge=0)
    unsigned: bool = Field(default=False, description="only the magnitude is recorded")

    @property
    def noise_variance(self) -> float:
        """Variance of noise and rounding of a row, in the square of the channel's unit."""
        return self.noise**2 + self.resolution**2 / 12


IDEAL = Sensor()
"""Sensor without errors."""


class Sensors(Section):
    """The sensor of each channel of a model, ideal by default."""

    position_rad: Sensor = IDEAL
    speed_rad_s: Sensor = IDEAL
    angle_rad: Sensor = IDEAL
    current_a_A: Sensor = IDEAL
    current_b_A: Sensor = IDEAL
    current_c_A: Sensor = IDEAL
    current_A: Sensor = IDEAL
    current_d_A: Sensor = IDEAL
    current_q_A: Sensor = IDEAL
    voltage_V: Sensor = IDEAL
    voltage_d_V: Sensor = IDEAL
    voltage_q_V: Sensor = IDEAL
    duty: Sensor = IDEAL

    def of(self, channel: str) -> Sensor:
        """Return the sensor of a channel, an ideal sensor for other channels."""
        return getattr(self, channel, IDEAL) if channel in Sensors.model_fields else IDEAL
