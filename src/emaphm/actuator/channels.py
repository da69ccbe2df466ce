"""`[channels]`: the columns in which a rig stores its channels, and their conversion into SI units."""

from typing import Annotated, Any, Literal, Self, get_args

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)

from emaphm.actuator.columns.expression import Expression
from emaphm.actuator.columns.units import check_unit
from emaphm.actuator.quantity import quantity
from emaphm.actuator.section import Section

OF_THE_LOGGER = "manual of the logger"

Name = Annotated[str, Field(min_length=1)]

Sampling = Literal["mean", "instant"]
"""Meaning of a row: the mean over its interval, or the value at its start."""

CommandHeld = Literal["before", "after"]
"""When a drive that holds the command receives that of a row: before or after the row is read."""

SAMPLINGS: tuple[Sampling, ...] = get_args(Sampling)


class ChannelEntry(Section):
    """One line of `[channels]`: a name, a number, or a table of these keys.

    A value raw in the file is converted to sign × (scale × raw + offset), in `unit`, and then into the SI
    unit of the channel. Without `column`, `derived` and `value`, the column has the channel's name.
    """

    column: str | None = Field(default=None, description="name in the file, 'group/name' where it has groups")
    derived: Name | None = Field(
        default=None, description="arithmetic of columns, such as 'command - error', in place of a column"
    )
    value: float | None = quantity(
        "known for the whole file, in place of a column", "unit of the entry", OF_THE_LOGGER, default=None
    )
    unit: str | None = Field(default=None, description="unit of scale × raw + offset; the SI unit if omitted")
    scale: float = quantity("factor", "unit per raw", OF_THE_LOGGER, default=1.0)
    offset: float = quantity("what is added", "unit of the entry", OF_THE_LOGGER, default=0.0)
    sign: Literal[1, -1] = Field(default=1, description="-1 where the logger counts the other way")
    delay_s: float = quantity(
        "how much later than the others the channel is recorded", "s", OF_THE_LOGGER, default=0.0
    )
    time: Name | None = Field(
        default=None, description="column with the times of this column, if it has separate times"
    )

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, given: Any) -> Any:
        if isinstance(given, str):
            return {"column": given}
        if isinstance(given, int | float) and not isinstance(given, bool):
            return {"value": given}
        if not isinstance(given, dict | ChannelEntry):
            raise ValueError('give the name of a column, a number, or a table such as { column = "name" }')  # noqa: TRY004 - pydantic's way
        return given

    @field_validator("derived")
    @classmethod
    def _parsed(cls, text: str | None) -> str | None:
        if text is not None:
            Expression.parse(text)
        return text

    @field_validator("unit")
    @classmethod
    def _check_unit(cls, unit: str | None) -> str | None:
        if unit is not None:
            check_unit(unit)
        return unit

    @model_validator(mode="after")
    def _check_source(self) -> Self:
        given = [name for name in ("column", "derived", "value") if getattr(self, name) is not None]
        if len(given) > 1:
            raise ValueError(f"{' and '.join(given)} exclude each other; keep one")
        if not self.scale:
            raise ValueError("a scale of 0 leaves nothing of the channel; give the unit per raw value")
        if self.value is not None and (self.delay_s or self.time):
            raise ValueError("a value for the whole file has no time; take out delay_s and time")
        if self.derived is not None and self.time:
            raise ValueError("a derived channel has the times of its columns; take out time")
        return self

    @model_serializer(mode="wrap")
    def _shortest(self, handler: SerializerFunctionWrapHandler) -> Any:
        given = {name: value for name, value in handler(self).items() if value != _DEFAULTS[name]}
        if given.keys() == {"column"}:
            return given["column"]
        return given

    @property
    def converts(self) -> bool:
        """Whether raw values are converted."""
        return self.unit is not None or (self.scale, self.offset, self.sign) != (1.0, 0.0, 1)


_DEFAULTS = {name: field.default for name, field in ChannelEntry.model_fields.items()}

OWN_NAME = ChannelEntry()
"""Entry of a column with the channel's name, in the channel's SI unit."""


class Channels(Section):
    """The entry of each channel, the sampling of the rows, and whether the drive holds the command."""

    sampling: Sampling = Field(
        default="mean", description="rows are means over the sample interval, or values at its start"
    )
    command_held: CommandHeld | None = Field(
        default=None,
        description="the drive holds each command, which is sent before or after its row is read",
    )
    time_s: ChannelEntry = OWN_NAME
    command_rad: ChannelEntry = OWN_NAME
    position_rad: ChannelEntry = OWN_NAME
    speed_rad_s: ChannelEntry = OWN_NAME
    angle_rad: ChannelEntry = OWN_NAME
    current_a_A: ChannelEntry = OWN_NAME
    current_b_A: ChannelEntry = OWN_NAME
    current_c_A: ChannelEntry = OWN_NAME
    current_A: ChannelEntry = OWN_NAME
    current_d_A: ChannelEntry = OWN_NAME
    current_q_A: ChannelEntry = OWN_NAME
    voltage_V: ChannelEntry = OWN_NAME
    voltage_d_V: ChannelEntry = OWN_NAME
    voltage_q_V: ChannelEntry = OWN_NAME
    duty: ChannelEntry = OWN_NAME
    supply_V: ChannelEntry = OWN_NAME
    enabled: ChannelEntry = OWN_NAME
    load_Nm: ChannelEntry = OWN_NAME
    temperature_K: ChannelEntry = OWN_NAME

    def entry(self, name: str) -> ChannelEntry:
        """Return the entry of the channel `name`."""
        entry: ChannelEntry = getattr(self, name)
        return entry

    @field_validator("time_s")
    @classmethod
    def _check_time(cls, entry: ChannelEntry) -> ChannelEntry:
        if entry.value is not None or entry.derived is not None or entry.delay_s or entry.time:
            raise ValueError("time is a column of its own; give its name, unit, scale and offset only")
        return entry


CHANNEL_NAMES = tuple(name for name in Channels.model_fields if name not in ("sampling", "command_held"))
"""The channels of the schema."""
