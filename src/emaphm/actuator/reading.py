"""`[reading]`: which rows of a file are used, how it is cut into recordings, and how they are cleaned."""

from typing import Annotated

from pydantic import Field, field_validator

from emaphm.actuator.columns.expression import Expression
from emaphm.actuator.parameters import Section
from emaphm.actuator.quantity import quantity

CHOSEN_BY_THE_OWNER = "the owner's choice"

Text = Annotated[str, Field(min_length=1)]


class Reading(Section):
    """What of a file is read. By default everything is, and only short gaps and outliers are replaced."""

    keep: Text | None = Field(
        default=None, description="condition on columns; only rows where it holds are used"
    )
    times: tuple[tuple[float, float], ...] = Field(
        default=(), strict=False, description="ranges of time [s]; only rows within one are used"
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

    @field_validator("times")
    @classmethod
    def _ordered(cls, ranges: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        for first, last in ranges:
            if not first < last:
                raise ValueError(f"the range [{first:g}, {last:g}] is empty; give [first, last] in s")
        return ranges
