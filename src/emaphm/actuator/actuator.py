"""The actuator as a whole, and its TOML."""

import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from emaphm.actuator.baseline import LINEAR, PARTS, Baseline
from emaphm.actuator.parameters import (
    Channels,
    Controller,
    Electrical,
    FaultScales,
    Mechanics,
    Motor,
    Nuisances,
    Section,
)
from emaphm.actuator.toml import validation_message, write_toml
from emaphm.errors import ActuatorError
from emaphm.input_files import read_toml
from emaphm.output_files import written_whole

PRESETS = ("thesis",)


class Actuator(Section):
    """Description of an electromechanical actuator: parameters, fault scales, channel names.

    Frozen and validated. SI units; with ``coordinates = "linear"`` the same fields hold m and N
    where they name rad and N·m. Without `electrical` the current loop is ideal.

    Source: thesis Tab. 3.1 for the structure and for `Actuator.thesis`.
    """

    name: Annotated[str, Field(min_length=1)]
    coordinates: Literal["rotary", "linear"] = "rotary"
    controller: Controller
    motor: Motor
    mechanics: Mechanics
    electrical: Electrical | None = None
    faults: FaultScales = FaultScales()
    nuisances: Nuisances = Nuisances()
    channels: Channels = Channels()
    baseline: Baseline | None = None

    @model_validator(mode="after")
    def _baseline_of_what_is_described(self) -> Self:
        for name in self.baseline.names if self.baseline else ():
            place, *fields = PARTS[name]
            section = getattr(self, place)
            if section is None:
                raise ValueError(f"'baseline.names': '{name}' needs an [{place}] section; add it")
            if name not in LINEAR and not sum(getattr(section, field) for field in fields) > 0:
                raise ValueError(
                    f"'baseline.names': '{name}' is 0 in [{place}]: nothing is relative to it; leave it out"
                )
        return self

    @classmethod
    def thesis(cls) -> Self:
        """Return the actuator of the thesis (Tab. 3.1), with the choices that it leaves open."""
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
    def from_toml(cls, path: str | Path) -> Self:
        """Read an actuator from a TOML file.

        Raises
        ------
        ActuatorError
            The file is missing or no TOML, or a key is unknown, missing or impossible; the message
            names the file, the key and the remedy.
        """
        path = Path(path)
        return cls.from_dict(read_toml(path, "actuator file", ActuatorError), where=str(path))

    @classmethod
    def from_dict(cls, values: dict[str, Any], *, where: str = "actuator") -> Self:
        """Validate `values` as an actuator; `where` names their origin in an error."""
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            raise ActuatorError(f"{where}: {validation_message(error, cls)}") from None

    @classmethod
    def load(cls, name: str | Path) -> Self:
        """Return the built-in actuator `name` ("thesis"), or the one in the TOML file of that path."""
        return cls.thesis() if str(name) in PRESETS else cls.from_toml(name)

    def to_toml(self, path: str | Path, *, comments: str = "") -> None:
        """Write the actuator as TOML, each value with its meaning and unit; `comments` goes on top.

        Raises
        ------
        OutputError
            The file cannot be written there.
        """
        with written_whole(path) as temporary:
            temporary.write_text(write_toml(self, comments), encoding="utf-8")
