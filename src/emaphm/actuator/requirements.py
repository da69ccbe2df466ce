"""`[[requirements]]`: limits of performance measures of an actuator, and of the levels of its faults."""

from typing import Literal, Self

from pydantic import Field, model_validator

from emaphm.actuator.quantity import CHOSEN, USER_ANGLE, quantity
from emaphm.actuator.section import Section

MOST_REQUIREMENTS = 50

LOWEST_FRICTION = -1.0
"""Least friction component of any actuator, reached if its scale is small (`faults.lower_bounds`)."""

ComponentName = Literal["friction", "backlash", "short_a", "short_b", "short_c", "eccentricity", "gain"]
"""Components that can degrade, in the order of `Faults`."""


def component_of(coordinate: str) -> str:
    """Return the component of an estimator's coordinate (`faults.CARTESIAN_NAMES`).

    Both coordinates of an eccentricity have the same; every other name is returned unchanged.
    """
    return coordinate.removesuffix("_x").removesuffix("_y")


MeasureName = Literal[
    "tracking_error", "bandwidth", "settling_time", "stall_margin", "peak_current", "free_play"
]

MEASURE_UNITS: dict[str, str] = {
    "tracking_error": USER_ANGLE,
    "bandwidth": "Hz",
    "settling_time": "s",
    "stall_margin": "-",
    "peak_current": "A",
    "free_play": USER_ANGLE,
}
"""Units of the measures for a rotary actuator."""


LOWEST_HZ, HIGHEST_HZ = 2.0, 100.0
"""Range in which bandwidths are searched; `frequency_hz` replaces the upper limit."""

MOST_PERIODS = 3000
"""Largest number of periods of a manoeuvre, each of which has at least 32 samples."""

LARGEST_STALL_MARGIN = 4.0
"""Largest multiple of the load that is simulated."""


class Requirement(Section):
    """One requirement: the level of a fault, or a performance measure of the actuator, is within its limits.

    A limit of a level, such as from a manual, has `component` and `at_most`, normalised as in `Faults`; for a
    decreasing friction, as with a lost preload, an `at_least` below 0. The averaged model computes measures:

    tracking_error
        Root mean square of command minus position, at the user, over the manoeuvre [rad].
    bandwidth
        Frequency at which the position's amplitude falls to 1/√2 (-3 dB) of a sine's [Hz].
    settling_time
        Time after which the position stays within 5 % of a step's amplitude [s].
    stall_margin
        Largest load that the actuator holds within `amplitude`, as a multiple of `load` [-].
    peak_current
        Largest magnitude of the current over the manoeuvre [A].
    free_play
        Backlash, full width at the user [rad].
    """

    name: str | None = Field(default=None, min_length=1, max_length=80, description="name of the requirement")
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
    amplitude: float = quantity("of the manoeuvre, at the user", USER_ANGLE, CHOSEN, default=5e-3, gt=0)
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
        lowest = LOWEST_FRICTION if self.component == "friction" else 0.0
        for limit in (self.at_most, self.at_least):
            if self.component is not None and limit is not None and not lowest <= limit <= 1:
                raise ValueError(
                    f"a level lies in [{lowest:g}, 1], got the limit {limit:g}; give it normalised"
                )
        if self.measure is not None and self.at_most is not None and self.at_most < 0:
            raise ValueError(f"no {self.measure} is below 0, got at_most = {self.at_most:g}")
        if self.measure == "stall_margin" and self.load == 0:
            raise ValueError("a stall_margin is a multiple of the load that must be held: give load")
        self._check_range()
        return self

    def _check_range(self) -> None:
        """Refuse limits outside the range that is simulated: they would be met never, or always."""
        limits = [limit for limit in (self.at_least, self.at_most) if limit is not None]
        if self.measure == "bandwidth":
            highest = self.frequency_hz or HIGHEST_HZ
            if not all(LOWEST_HZ < limit <= highest for limit in limits):
                raise ValueError(
                    f"a bandwidth is looked for from {LOWEST_HZ:g} to {highest:g} Hz: give limits above "
                    f"{LOWEST_HZ:g}, and a frequency_hz above them"
                )
        if self.measure == "stall_margin" and max(limits) > LARGEST_STALL_MARGIN:
            raise ValueError(
                f"the load is raised to {LARGEST_STALL_MARGIN:g} times itself: give a stall_margin of "
                f"{LARGEST_STALL_MARGIN:g} at most, of a larger load"
            )
        if self.measure in ("tracking_error", "peak_current") and self.command != "step":
            periods = (self.frequency_hz or 0.0) * self.duration
            if periods > MOST_PERIODS:
                raise ValueError(
                    f"frequency_hz = {self.frequency_hz:g} over duration = {self.duration:g} s are "
                    f"{periods:,.0f} periods, {MOST_PERIODS:,} are simulated at most: give a shorter duration"
                )
        if self.measure == "settling_time" and max(limits) > self.duration:
            raise ValueError(
                f"a settling_time is looked for within duration = {self.duration:g} s: give a longer duration"
            )
