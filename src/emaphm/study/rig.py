"""Settings of a study's recordings: the manoeuvre, and the rig with its unknown quantities.

This module contains only values, which are part of the keys of results (`emaphm.study.store.tasks`). The code
that uses them is in `emaphm.study.record`, and is part of the fingerprint of results.
"""

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, field_validator, model_validator

from emaphm.actuator import Actuator, Chirp
from emaphm.actuator.laws import law_named
from emaphm.actuator.section import Section
from emaphm.actuator.unit.tolerances import Tolerances
from emaphm.errors import StudyError, nearest
from emaphm.recording.acquisition import check_bits
from emaphm.recording.schema import SCHEMA

MOST_HEAT_K = 200.0
"""Largest temperature rise of windings and magnets that a rig may have [K]."""


def _known_bits(bits: int) -> int:
    check_bits(bits)
    return bits


Label = Annotated[str, Field(min_length=1, max_length=60)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
NoiseA = Annotated[float, Field(ge=0)]
Duration = Annotated[float, Field(gt=0, le=30)]
SampleRate = Annotated[float, Field(gt=0, le=1e5)]
AdcBits = Annotated[int, AfterValidator(_known_bits)]
HeatK = Annotated[float, Field(ge=-MOST_HEAT_K, le=MOST_HEAT_K)]
HallDegrees = Annotated[float, Field(ge=-30, le=30)]
Relative = Annotated[float, Field(gt=-1, le=10)]


class Manoeuvre(Section):
    """The chirp of the recordings: amplitude [rad], frequencies [Hz], duration [s], sampling rate [Hz]."""

    amplitude: float = 5e-3
    start_hz: NotNegative = 0.0
    stop_hz: Positive = 15.0
    duration: Duration = 0.5
    sample_rate: SampleRate = 5000.0

    def chirp(self, actuator: Actuator, duration: float) -> Chirp:
        """Return the command of `duration` [s], about 0 or about the middle of the travel of `actuator`."""
        about = actuator.mechanics.start_for(-self.amplitude, self.amplitude)
        return Chirp(self.amplitude, self.start_hz, self.stop_hz, duration, about)

    @model_validator(mode="after")
    def _slower_than_the_rows(self) -> Self:
        if max(self.start_hz, self.stop_hz) > self.sample_rate / 2:
            raise ValueError(
                f"'start_hz' {self.start_hz:g} and 'stop_hz' {self.stop_hz:g} must not be above half of "
                f"'sample_rate' {self.sample_rate:g}"
            )
        return self


class Stribeck(Section):
    """Friction that falls smoothly from its static to its dynamic level, and through 0 at standstill.

    (f_d + (f_s - f_d) exp(-(w / speed)²)) tanh(w / smoothing), both in rad/s.
    """

    speed: Positive
    smoothing: Positive


class Bristles(Section):
    """Friction with presliding: the LuGre model of Canudas de Wit, with Stribeck's levels.

    `bend` is the bend of the bristles at the static level of a healthy plant, at the motor [rad]; the levels
    fall over `speed` [rad/s]; `damping` is relative to critical damping.
    """

    bend: Positive
    speed: Positive
    damping: NotNegative = 0.2


class BackEmf(Section):
    """The shape of each phase's back-EMF: the trapezoid's flat [electrical degrees], and a share of a sine.

    The peak from line to line is that of the description.
    """

    flat: Annotated[float, Field(ge=60, lt=180)] = 120.0
    sine: Annotated[float, Field(ge=0, le=1)] = 0.0


class Shaft(Section):
    """A torsional spring with a damper, stiffness [N·m/rad] and damping [N·m·s/rad] at the motor."""

    stiffness: Positive
    damping: NotNegative


class ForeignFeatures(Section):
    """Features of a foreign plant that the reference model lacks; none by default.

    `hall` is the lead with which the Hall sensor of each phase switches, `hall_hysteresis` its delay in
    either direction [electrical degrees]; `commutation_delay` is the delay of the commutation [s],
    `sensor_lag` the time constant of the current sensors [s].
    """

    friction: Stribeck | Bristles | None = None
    shaft: Shaft | None = None
    back_emf: BackEmf = BackEmf()
    hall: tuple[HallDegrees, HallDegrees, HallDegrees] = (0.0, 0.0, 0.0)
    hall_hysteresis: Annotated[float, Field(ge=0, le=10)] = 0.0
    commutation_delay: Annotated[float, Field(ge=0, le=2e-4)] = 0.0
    sensor_lag: NotNegative = 0.0


class VaryingLoad(Section):
    """A load at the motor that varies during the recording, in addition to the constant load.

    It contains a sine of amplitude `swing` [N·m] and `frequency` [Hz], a ramp of `drift` [N·m/s], and a load
    stiffness `hinge` [N·m/rad] on the user's position. In the middle of the recording it steps by `step`
    [N·m], within `rise` [s], until the end or for `lasts` [s].
    """

    swing: float = 0.0
    frequency: Positive = 1.0
    drift: float = 0.0
    step: float = 0.0
    rise: NotNegative = 0.0
    lasts: Positive | None = None
    hinge: NotNegative = 0.0


class Rig(Section):
    """Recorded channels, noise and converters, and the deviations of the actuator from its description.

    The defaults are the base setting of the pages: noise and converters; load and temperature unknown;
    current and line voltage recorded. Load, heat, supply and inertia are drawn for each case from their
    ranges.

    Parameters
    ----------
    label
        Name of the rig in the results.
    channels
        Channels recorded in addition to time and command; must contain `current_A`.
    noise
        White noise on the current, rms [A].
    adc_bits
        Resolution of the converters of all channels [bit]; "exact" for no quantisation.
    sample_rate, duration
        Sampling rate [Hz] and duration [s]; by default those of the manoeuvre.
    load
        Range of a constant load at the motor shaft, added to the nominal one [N·m].
    heat
        Range of the temperature rise of windings and magnets [K].
    supply, inertia
        Ranges of the relative deviations of supply voltage and inertia.
    tolerances, stated
        Tolerances of described parameters, from which those of each case's unit are drawn; if `stated`, the
        description that the diagnosis uses contains the tolerances, otherwise its parameters count as exact.
    controller_noise
        White noise on the reference current, rms [A] per step (thesis 4.1); for the reference model only.
    varying_load
        A load that varies; for the reference model only.
    foreign
        Features of a foreign plant, which then simulates the recording in place of the reference model.
    calibrated
        Laws with which the actuator is calibrated before, on three healthy recordings of the rig; with
        "auto", the calibration selects the laws.
    """

    label: Label
    channels: tuple[str, ...] = ("current_A", "voltage_V")
    noise: NoiseA = 0.05
    adc_bits: AdcBits | None = 12
    sample_rate: SampleRate | None = None
    duration: Duration | None = None
    load: tuple[float, float] = (-0.2, 0.2)
    heat: tuple[HeatK, HeatK] = (-40.0, 40.0)
    supply: tuple[Relative, Relative] = (0.0, 0.0)
    inertia: tuple[Relative, Relative] = (0.0, 0.0)
    tolerances: Tolerances | None = None
    stated: bool = False
    controller_noise: NotNegative = 0.0
    varying_load: VaryingLoad | None = None
    foreign: ForeignFeatures | None = None
    calibrated: tuple[str, ...] | Literal["auto"] = ()

    @field_validator("calibrated")
    @classmethod
    def _check_laws(cls, names: tuple[str, ...] | Literal["auto"]) -> tuple[str, ...] | Literal["auto"]:
        for name in () if names == "auto" else names:
            law_named(name)
        return names

    @field_validator("adc_bits", mode="before")
    @classmethod
    def _exact(cls, value: Any) -> Any:
        return None if value == "exact" else value

    @field_validator("channels")
    @classmethod
    def _check_channels(cls, channels: tuple[str, ...]) -> tuple[str, ...]:
        for name in channels:
            if name not in SCHEMA:
                raise StudyError(f"unknown channel '{name}'{nearest(name, SCHEMA)}")
        if "current_A" not in channels:
            raise StudyError("'current_A' is missing; a diagnosis needs it")
        return channels

    @field_validator("load", "heat", "supply", "inertia")
    @classmethod
    def _check_range(cls, ends: tuple[float, float]) -> tuple[float, float]:
        if ends[0] > ends[1]:
            raise StudyError(f"the range ends before it begins ({ends[0]:g} to {ends[1]:g}); swap the two")
        return ends

    @model_validator(mode="after")
    def _check_foreign_plant(self) -> "Rig":
        if self.foreign is not None and self.controller_noise:
            raise StudyError("a foreign plant's controller has no noise; leave out 'controller_noise'")
        if self.foreign is not None and self.varying_load is not None:
            raise StudyError("a foreign plant has a constant load; leave out 'varying_load'")
        return self

    @model_validator(mode="after")
    def _check_stated(self) -> "Rig":
        if self.stated and self.tolerances is None:
            raise StudyError(
                "there are no 'tolerances' that could be stated; give some, or leave out 'stated'"
            )
        return self

    @property
    def facts(self) -> str:
        """The rig in one line."""
        ranges = {"load": "N·m", "heat": "K", "supply": "", "inertia": ""}
        drawn = [
            f"{name} {low:+g} to {high:+g} {unit}".rstrip()
            for name, unit in ranges.items()
            for low, high in [getattr(self, name)]
            if (low, high) != (0, 0)
        ]
        bits = "exact converters" if self.adc_bits is None else f"{self.adc_bits} bits"
        if self.tolerances is not None:
            drawn.append(f"a unit within tolerances that are {'' if self.stated else 'not '}stated")
        if self.varying_load is not None:
            drawn.append("a load that varies")
        plant = [] if self.foreign is None else ["foreign plant"]
        return f"{self.label}: {', '.join([*self.channels, f'{self.noise:g} A noise', bits, *drawn, *plant])}"
