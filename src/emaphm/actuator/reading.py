"""`[reading]`: selection of the rows of a file, cutting into recordings, and cleaning."""

from typing import Annotated, Any

from pydantic import Field, field_validator

from emaphm.actuator.channels import CHANNEL_NAMES
from emaphm.actuator.columns.expression import Expression
from emaphm.actuator.quantity import quantity
from emaphm.actuator.section import Section
from emaphm.errors import nearest

CHOSEN_BY_THE_OWNER = "the owner's choice"

ALWAYS_THERE = ("time_s", "command_rad")
"""Channels that every recording has."""

Text = Annotated[str, Field(min_length=1)]


class Reading(Section):
    """Settings for reading a file; by default all rows are used, short gaps and outliers are replaced."""

    keep: Text | None = Field(
        default=None, description="condition on columns; only rows where it holds are used"
    )
    times: tuple[tuple[float, float], ...] = Field(
        default=(), strict=False, description="ranges of time [s]; only rows within one are used"
    )
    ignore: tuple[Text, ...] = Field(
        default=(), strict=False, description="channels that are not read although the file has them"
    )
    dwell_s: float | None = quantity(
        "rests of the command that last longer are left out", "s", CHOSEN_BY_THE_OWNER, default=None, gt=0
    )
    split: Text | None = Field(
        default=None,
        description="what a file is cut by: names of columns with commas between, 'period' of the command, "
        "its 'rests', or 'stretches' without a gap",
    )
    serial: Text | None = Field(
        default=None, description="column with the serial number of the unit, the same throughout a recording"
    )
    longest_gap: int = Field(
        default=3, ge=0, strict=True, description="longest gap that is interpolated [rows]"
    )
    outliers: bool = Field(
        default=True, strict=True, description="whether isolated outliers are found and replaced"
    )
    low_pass_hz: float | None = quantity(
        "bandwidth of a zero-phase low-pass on all sensed channels; none where left out",
        "Hz", CHOSEN_BY_THE_OWNER, default=None, gt=0,
    )  # fmt: skip

    @field_validator("keep")
    @classmethod
    def _parsed(cls, text: str | None) -> str | None:
        if text is not None:
            Expression.parse(text)
        return text

    @field_validator("ignore")
    @classmethod
    def _check_ignored(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        possible = [name for name in CHANNEL_NAMES if name not in ALWAYS_THERE]
        for name in names:
            if name in ALWAYS_THERE:
                raise ValueError(f"'{name}' is needed of every recording; take it out of ignore")
            if name not in possible:
                raise ValueError(f"unknown channel '{name}'{nearest(name, possible)}")
        return names

    @field_validator("times", mode="before")
    @classmethod
    def _check_ranges(cls, given: Any) -> Any:
        if isinstance(given, list | tuple) and all(isinstance(limits, list | tuple) for limits in given):
            return given
        raise ValueError("give a list of ranges [first, last] in s, such as [[0.5, 2.0]]")

    @field_validator("times")
    @classmethod
    def _check_order(cls, ranges: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        for first, last in ranges:
            if not first < last:
                raise ValueError(f"the range [{first:g}, {last:g}] is empty; give [first, last] in s")
        return ranges
