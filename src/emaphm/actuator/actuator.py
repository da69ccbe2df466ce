"""The description of an actuator, with its sections, presets and TOML file."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, ValidationError, model_validator

from emaphm.actuator.channels import Channels
from emaphm.actuator.law_sections import Drive, DriveKind, Friction, RippleHarmonic, Transmission, Weight
from emaphm.actuator.nuisance_priors import Nuisances
from emaphm.actuator.parameters import Controller, Electrical, FaultScales, Mechanics, Motor
from emaphm.actuator.quantity import Coordinates
from emaphm.actuator.reading import Reading
from emaphm.actuator.requirements import MOST_REQUIREMENTS, Requirement
from emaphm.actuator.section import Section
from emaphm.actuator.sensors import Sensors
from emaphm.actuator.toml import validation_message, write_toml
from emaphm.actuator.unit.baseline import COMMUTATION, HALL_SENSORS, MOST_HARMONICS, PARTS, SIGNED, Baseline
from emaphm.actuator.unit.model_error import NOT_LEARNED, ModelError
from emaphm.actuator.unit.tolerances import Tolerances
from emaphm.errors import ActuatorError, nearest
from emaphm.input_files import exists, read_toml
from emaphm.output_files import written_whole

PRESETS = ("thesis", "six-step", "pmsm", "dc")

SAME_PRESET = {"bldc": "thesis"}
"""Presets by an alternative name, which names the type of machine."""


class Actuator(Section):
    """Description of an electromechanical actuator: parameters, fault scales, channel names.

    Frozen and validated. All values are in SI units. With ``coordinates = "linear"``, m and N replace rad and
    N·m; with ``"screw"``, only the user's quantities are in m. Without `electrical`, the current loop is
    ideal. `friction`, `transmission`, `weight` and `ripple` contain optional laws. `tolerances` contains the
    largest expected deviations of parameters. `baseline` and `model_error` are results of a calibration of
    the healthy unit: the covariance of its parameters, and the remaining error of the model.

    Source: thesis Tab. 3.1 for the structure and for `Actuator.thesis`; `Actuator.pmsm` and `Actuator.dc`
    have other motors and drives.
    """

    name: Annotated[str, Field(min_length=1)]
    coordinates: Coordinates = "rotary"
    controller: Controller
    motor: Motor
    mechanics: Mechanics
    electrical: Electrical | None = None
    drive: Drive | None = None
    friction: Friction | None = None
    transmission: Transmission | None = None
    weight: Weight | None = None
    ripple: tuple[RippleHarmonic, ...] = Field(
        default=(), strict=False, max_length=MOST_HARMONICS, description="harmonics of the torque ripple"
    )
    faults: FaultScales = FaultScales()
    nuisances: Nuisances = Nuisances()
    channels: Channels = Channels()
    reading: Reading = Reading()
    sensors: Sensors = Sensors()
    tolerances: Tolerances | None = None
    baseline: Baseline | None = None
    model_error: ModelError = NOT_LEARNED
    requirements: tuple[Requirement, ...] = Field(
        default=(), strict=False, max_length=MOST_REQUIREMENTS, description="what the actuator must do"
    )

    @model_validator(mode="after")
    def _check_drive(self) -> Self:
        e, kind = self.electrical, self.drive_kind
        if kind == "current" and e is not None:
            raise ValueError("'drive.kind' = \"current\" has an ideal current loop; take out [electrical]")
        if kind != "current" and e is None:
            raise ValueError(f"'drive.kind' = \"{kind}\" needs an [electrical] section; add it")
        if kind == "hysteresis" and e is not None and e.hysteresis is None:
            raise ValueError("'electrical.hysteresis' is missing; a drive of kind \"hysteresis\" needs it")
        if self.drive and self.drive.current_lag is not None and kind in ("current", "voltage"):
            raise ValueError(
                f"'drive.current_lag': a drive of kind \"{kind}\" senses no current; take it out"
            )
        if self.drive and self.drive.source_resistance is not None and kind == "current":
            raise ValueError("'drive.source_resistance': an ideal current loop has no supply; take it out")
        if self.drive and self.drive.voltage_drop is not None and kind == "current":
            raise ValueError("'drive.voltage_drop': an ideal current loop has no voltage; take it out")
        if self.weight and self.has_linear_user:
            raise ValueError("'weight' turns with a rotary actuator; a linear one has mechanics.offset")
        if self.transmission and not (self.mechanics.inertia_motor > 0 and self.mechanics.inertia_user > 0):
            raise ValueError(
                "[transmission] joins two inertias: give mechanics.inertia_motor and inertia_user above 0"
            )
        return self

    @model_validator(mode="after")
    def _check_commutation(self) -> Self:
        for name in COMMUTATION:
            if getattr(self.drive, name, None) is not None and not self.commutates:
                raise ValueError(
                    f"'drive.{name}': a drive of kind \"{self.drive_kind}\" does not commutate; take it out"
                )
        return self

    @model_validator(mode="after")
    def _check_back_emf(self) -> Self:
        for name in ("flat_loss", "sine_share", *HALL_SENSORS):
            if getattr(self.motor, name) is not None and not self.commutates:
                raise ValueError(
                    f"'motor.{name}': the motor of a drive of kind \"{self.drive_kind}\" has no trapezoidal "
                    "back-EMF; take it out"
                )
        return self

    @model_validator(mode="after")
    def _check_requirements(self) -> Self:
        stops = self.mechanics.end_stops
        reach = float("inf") if stops is None else (stops[1] - stops[0]) / 2
        for i, requirement in enumerate(self.requirements):
            if requirement.measure not in (None, "free_play") and requirement.amplitude > reach:
                raise ValueError(
                    f"'requirements[{i}].amplitude': {requirement.amplitude:g} is beyond the end stops "
                    f"{list(stops or ())}; give {reach:g} or less"
                )
        return self

    @model_validator(mode="after")
    def _check_deviations(self) -> Self:
        deviating = [("baseline.names", name) for name in self.baseline.names] if self.baseline else []
        deviating += [("tolerances", name) for name in self.tolerances.names] if self.tolerances else []
        for key, name in deviating:
            values = described_parts(self, name)
            if values is None:
                raise ValueError(f"'{key}': '{name}' needs [{PARTS[name][0]}] with it; add it")
            if name not in SIGNED and not sum(values) > 0:
                raise ValueError(
                    f"'{key}': '{name}' is {sum(values):g} in [{PARTS[name][0]}], and a relative deviation "
                    "needs a value above 0; leave it out"
                )
        return self

    @property
    def open_tolerances(self) -> Tolerances | None:
        """The tolerances of parameters that no calibration has estimated, None if there are none."""
        calibrated = () if self.baseline is None else self.baseline.names
        return None if self.tolerances is None else self.tolerances.without(calibrated)

    @property
    def uncertain_parameters(self) -> tuple[str, ...]:
        """Parameters in the baseline, then those with a tolerance that no calibration has estimated."""
        calibrated = () if self.baseline is None else self.baseline.names
        tolerances = self.open_tolerances
        return (*calibrated, *(tolerances.names if tolerances else ()))

    @property
    def drive_kind(self) -> DriveKind:
        """The kind of drive; without [drive], it is "hysteresis" with [electrical], else "current"."""
        if self.drive is not None:
            return self.drive.kind
        return "hysteresis" if self.electrical is not None else "current"

    @property
    def has_linear_motor(self) -> bool:
        """Whether quantities at the motor are in m, N and kg."""
        return self.coordinates == "linear"

    @property
    def has_linear_user(self) -> bool:
        """Whether the user's position is in m."""
        return self.coordinates != "rotary"

    @property
    def three_phases(self) -> bool:
        """Whether the motor has three phases, which can be shorted, and a rotor between them."""
        return self.drive_kind in ("hysteresis", "six-step", "foc")

    @property
    def commutates(self) -> bool:
        """Whether two phases conduct at a time, selected by the rotor's angle: a trapezoidal back-EMF."""
        return self.drive_kind in ("hysteresis", "six-step")

    @property
    def pole_pairs(self) -> int:
        """Number of the motor's pole pairs; 1 without an electrical description."""
        return self.electrical.pole_pairs if self.electrical else 1

    @property
    def drive_constant(self) -> float:
        """Torque per ampere that the drive assumes [N·m/A]."""
        return self.controller.torque_constant or self.motor.torque_constant

    @classmethod
    def thesis(cls) -> Self:
        """Return the actuator of the thesis (Tab. 3.1), with chosen values where the thesis gives none."""
        torque_limit = 1.689
        return cls(
            name="thesis",
            controller=Controller(
                position_gain=1e5,
                speed_gain=5e-2,
                speed_limit=8000 * math.pi / 30,
                current_limit=22.5,
                torque_constant=0.0752,
            ),
            motor=Motor(torque_constant=0.0752, torque_limit=torque_limit),
            mechanics=Mechanics(
                inertia_motor=1.3e-5,
                inertia_user=1.2e-5,
                viscous_motor=30 / math.pi * 1e-6,
                viscous_user=4.5e-7,
                static_friction_motor=0.06 * torque_limit,
                static_friction_user=0.04 * torque_limit,
                dynamic_friction_motor=0.03 * torque_limit,
                dynamic_friction_user=0.02 * torque_limit,
                backlash=5e-3,
                gear_ratio=1 / 500,
                end_stops=(-0.5236, 0.5236),
            ),
            electrical=Electrical(
                supply=48.0, resistance=2.13, inductance=7.2e-4, pole_pairs=2, hysteresis=0.5
            ),
        )

    @classmethod
    def pmsm(cls) -> Self:
        """Return the thesis's mechanics and windings with sinusoidal back-EMF and field-oriented control.

        The PWM frequency is 20 kHz. The current loop has a bandwidth of 250 Hz, with the gains 2π × 250 Hz ×
        (L_s, R_s): it is stable down to 30 % of the turns in all phases, where the inductance is 9 %. The
        speed loop is four times as slow as the thesis's, so that the current loop is three times as fast.
        """
        thesis = cls.thesis()
        return cls(
            name="pmsm",
            controller=thesis.controller.model_copy(update={"speed_gain": 1.25e-2}),
            motor=thesis.motor,
            mechanics=thesis.mechanics,
            electrical=Electrical(supply=48.0, resistance=2.13, inductance=7.2e-4, pole_pairs=2),
            drive=Drive(kind="foc", current_gain=1.13, current_integral_gain=3350.0, pwm_frequency=2e4),
        )

    @classmethod
    def six_step(cls) -> Self:
        """Return the thesis's mechanics and motor with six-step control and 20 kHz PWM.

        The gains are the same as those of `pmsm`, for the same reasons.
        """
        controlled = cls.pmsm()
        drive = controlled.drive.model_copy(update={"kind": "six-step"}) if controlled.drive else None
        return controlled.model_copy(update={"name": "six-step", "drive": drive})

    @classmethod
    def dc(cls) -> Self:
        """Return the thesis's mechanics with a DC motor with an ideal current loop, without windings.

        It can have faults of friction, backlash and gain, but no short circuits or eccentricity.
        """
        thesis = cls.thesis()
        return cls(
            name="dc",
            controller=thesis.controller,
            motor=thesis.motor,
            mechanics=thesis.mechanics,
            drive=Drive(kind="current"),
        )

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """Read an actuator from a TOML file.

        Raises
        ------
        ActuatorError
            The file is missing or no TOML, or a key is unknown or missing, or a value impossible; the message
            names the file, the key and the remedy.
        """
        path = Path(path)
        return cls.from_dict(read_toml(path, "actuator file", ActuatorError), where=str(path))

    @classmethod
    def from_dict(cls, values: dict[str, Any], *, where: str = "actuator") -> Self:
        """Return the actuator with `values` as in its TOML file; `where` names their origin in errors.

        Raises
        ------
        ActuatorError
            A key is unknown or missing, or a value impossible; the message names the key and the remedy.
        """
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            raise ActuatorError(f"{where}: {validation_message(error, cls)}") from None

    def changed(self, values: Mapping[str, Any]) -> Self:
        """Return the actuator with changed `values`, by key as in its TOML: {"mechanics.backlash": 0.01}.

        Raises
        ------
        ActuatorError
            A key is unknown, or a value impossible.
        """
        described = self.model_dump(mode="json", exclude_none=True)
        for key, value in values.items():
            *sections, name = key.split(".")
            place = described
            for section in sections:
                below = place.get(section)
                place[section] = place = below if isinstance(below, dict) else {}
            place[name] = value
        return self.from_dict(described, where=f"actuator '{self.name}'")

    @classmethod
    def load(cls, name: str | Path) -> Self:
        """Return the built-in actuator `name`, or the actuator in the TOML file with that path.

        Parameters
        ----------
        name
            One of `PRESETS`, "bldc" for "thesis", or a path.

        Raises
        ------
        ActuatorError
            The name is neither a built-in actuator nor a file; or as for `from_toml`.
        """
        built_in = SAME_PRESET.get(str(name), str(name))
        if built_in not in PRESETS:
            path = Path(name)
            if not exists(path, ActuatorError) and not path.is_symlink():
                known = (*PRESETS, *SAME_PRESET)
                raise ActuatorError(
                    f"{name}: no such actuator file{nearest(str(name), known, 'built in')}; give the path of "
                    "its TOML, or a built-in actuator"
                )
            return cls.from_toml(path)
        preset: Self = getattr(cls, built_in.replace("-", "_"))()
        return preset

    def to_toml(self, path: str | Path, *, comments: str = "", ending: str = "") -> None:
        """Write the actuator as TOML, each value with its meaning and unit; an existing file is replaced.

        `comments` is written at the top and `ending` at the end, both as comments.

        Raises
        ------
        OutputError
            The file cannot be written.
        """
        with written_whole(path) as temporary:
            # A recording's name may be invalid text: characters that cannot be encoded become question marks.
            temporary.write_text(write_toml(self, comments, ending), encoding="utf-8", errors="replace")


def described_parts(actuator: Actuator, name: str) -> tuple[float, ...] | None:
    """Return the described values whose sum is the lumped parameter `name`, None if they are absent."""
    section, *fields = PARTS[name]
    if section == "ripple":
        place, field = int(fields[0]) - 1, fields[1]
        return (getattr(actuator.ripple[place], field),) if place < len(actuator.ripple) else None
    described = getattr(actuator, section)
    if described is None:
        return None
    values = [getattr(described, field) for field in fields]
    return None if any(value is None for value in values) else tuple(values)
