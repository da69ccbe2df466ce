"""What an actuator must do: limits of what it is measured by, and of the levels of its faults."""

from typing import Literal, Self

from pydantic import Field, model_validator

from emaphm.actuator.parameters import CHOSEN, Section
from emaphm.actuator.quantity import quantity

MOST_REQUIREMENTS = 50

ComponentName = Literal["friction", "backlash", "short_a", "short_b", "short_c", "eccentricity", "gain"]

MeasureName = Literal[
    "tracking_error", "bandwidth", "settling_time", "stall_margin", "peak_current", "free_play"
]

MEASURE_UNITS: dict[str, str] = {
    "tracking_error": "rad",
    "bandwidth": "Hz",
    "settling_time": "s",
    "stall_margin": "-",
    "peak_current": "A",
    "free_play": "rad",
}
"""Units of the measures, of a rotary actuator."""


class Requirement(Section):
    """One requirement: a fault's level, or a measure of what the actuator does, is within its limits.

    A level is that of a manual: `component` and `at_most`, normalised as in `Faults`. A measure is computed
    by the averaged model:

    tracking_error
        Root mean square of command minus position, at the user, over the manoeuvre [rad].
    bandwidth
        Frequency at which the position's amplitude falls to 1/√2 (-3 dB) of a sine's [Hz].
    settling_time
        Time after which the position stays within 5 % of a step's amplitude [s].
    stall_margin
        Load that it holds within `amplitude`, as a multiple of `load` [-].
    peak_current
        Largest magnitude of the current over the manoeuvre [A].
    free_play
        Backlash, full width at the user [rad].
    """

    name: str | None = Field(default=None, min_length=1, max_length=80, description="how it is called")
    component: ComponentName | None = None
    measure: MeasureName | None = None
    at_most: float | None = quantity(
        "upper limit, in the measure's unit or normalised", "-", CHOSEN, default=None
    )
    at_least: float | None = quantity(
        "lower limit, in the measure's unit or normalised", "-", CHOSEN, default=None
    )
    command: Literal["chirp", "step", "sine"] = Field(
        default="chirp", description="manoeuvre of tracking_error and peak_current"
    )
    amplitude: float = quantity("of the manoeuvre, at the user", "rad", CHOSEN, default=5e-3, gt=0)
    frequency_hz: float | None = quantity(
        "of a sine, or the highest of a chirp, or that a bandwidth may have; 4, 15 and 100 where left out",
        "Hz",
        CHOSEN,
        default=None,
        gt=0,
        le=1000,
    )
    duration: float = quantity("of the manoeuvre", "s", CHOSEN, default=0.5, gt=0, le=60)
    load: float = quantity("constant load at the motor shaft", "N·m", CHOSEN, default=0.0)

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if (self.component is None) == (self.measure is None):
            raise ValueError(
                "a requirement is on a component's level or on a measure: give component or measure, not both"
            )
        if self.at_most is None and self.at_least is None:
            raise ValueError("a requirement needs a limit: give at_most or at_least")
        if self.at_most is not None and self.at_least is not None and not self.at_least < self.at_most:
            raise ValueError(f"at_least = {self.at_least:g} must be below at_most = {self.at_most:g}")
        for limit in (self.at_most, self.at_least):
            if self.component is not None and limit is not None and not 0 <= limit <= 1:
                raise ValueError(f"a level lies in [0, 1], got the limit {limit:g}; give it normalised")
        if self.measure == "stall_margin" and self.load == 0:
            raise ValueError("a stall_margin is a multiple of the load that must be held: give load")
        return self
