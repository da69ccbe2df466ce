"""Campaign: recordings of one healthy unit, each with its known values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import (
    LUMPED_PARAMETERS,
    check_lumped_parameters,
    lumped_parameters,
    with_lumped_parameters,
)
from emaphm.errors import ActuatorError, MethodError, nearest
from emaphm.recording import Recording
from emaphm.recording.argument import check_recording

KNOWN_CHANNELS = {"load": "load_Nm", "temperature": "temperature_K"}
"""Quantities that may be known as one number instead of a recorded channel, with that channel: the load at
the motor [N·m], and the temperature of windings and magnets [K]."""


@dataclass(frozen=True, eq=False)
class CampaignRow:
    """One recording of a campaign.

    Attributes
    ----------
    recording
        Recording of the healthy unit.
    known
        Known values of this recording in SI units: of lumped parameters, of the `load` [N·m] or of the
        `temperature` [K].
    free
        Lumped parameters that are estimated for this recording alone. If such a parameter is also shared by
        all recordings, its value in this recording may deviate from the shared value.
    place
        Location of the row for error messages: "campaign.csv, row 2".
    """

    recording: Recording
    known: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    free: tuple[str, ...] = ()
    place: str = ""

    @property
    def where(self) -> str:
        """Start of the error messages of this row: its place, or the source of its recording."""
        return self.place or self.recording.source

    @property
    def parameters(self) -> dict[str, float]:
        """Known lumped parameters, in SI units."""
        return {name: value for name, value in self.known.items() if name not in KNOWN_CHANNELS}

    def completed(self) -> Recording:
        """Return the recording with a constant channel for a known load or temperature."""
        added = {
            channel: np.full(self.recording.samples, self.known[name])
            for name, channel in KNOWN_CHANNELS.items()
            if name in self.known
        }
        if not added:
            return self.recording
        channels = {**self.recording.channels, **added}
        return Recording(channels, self.recording.sampling, self.recording.source, self.recording.notes)

    def described(self, actuator: Actuator, shared: Sequence[str] = ()) -> Actuator:
        """Return the actuator with the known parameters of this row; the `shared` parameters as described.

        Raises
        ------
        MethodError
            A value is impossible, such as a gain that is not positive.
        """
        if not self.parameters:
            return actuator
        shared_values = lumped_parameters(actuator, tuple(shared))
        try:
            return with_lumped_parameters(actuator, shared_values | self.parameters)
        except ActuatorError as error:
            reason = str(error).removeprefix(f"{actuator.name}: ")
            given = ", ".join(f"{name} = {value:g}" for name, value in self.parameters.items())
            raise MethodError(f"{self.where}: {given} is impossible: {reason}; correct the value") from None


Recordings: TypeAlias = Recording | CampaignRow | Sequence[Recording | CampaignRow]
"""Input of a calibration: one recording or several, each with or without known values."""


def campaign_rows(recordings: Recordings) -> tuple[CampaignRow, ...]:
    """Return one row per recording."""
    given = (recordings,) if isinstance(recordings, Recording | CampaignRow) else tuple(recordings)
    rows = tuple(item if isinstance(item, CampaignRow) else CampaignRow(item) for item in given)
    for row in rows:
        check_recording(row.recording)
    return rows


def check_row(row: CampaignRow, actuator: Actuator, shared: Sequence[str]) -> None:
    """Check a row against its recording, the actuator and the `shared` free parameters.

    Raises
    ------
    MethodError
        A name is unknown, or needs a section that the actuator lacks; a parameter is both known and free; a
        load or temperature is both given and recorded; a value is impossible.
    """
    for name, value in row.known.items():
        check_known_name(name, row.where)
        if not np.isfinite(value):
            raise MethodError(f"{row.where}: {name} = {value:g} is no finite number; correct it")
        if name in shared:
            raise MethodError(
                f"{row.where}: '{name}' is known here, and free for all recordings; leave one of the two out"
            )
        if name in row.free:
            raise MethodError(f"{row.where}: '{name}' is both known and free here; leave one of the two out")
        if KNOWN_CHANNELS.get(name) in row.recording:
            raise MethodError(
                f"{row.where}: '{name}' is given, and {row.recording.source} has the column "
                f"'{KNOWN_CHANNELS[name]}'; leave one of the two out"
            )
    if row.known.get("temperature", 1.0) <= 0:
        raise MethodError(
            f"{row.where}: temperature = {row.known['temperature']:g} K is not above 0; give it in kelvin"
        )
    try:
        check_lumped_parameters(actuator, (*row.parameters, *row.free))
    except MethodError as error:
        raise MethodError(f"{row.where}: {error}") from None
    row.described(actuator, shared)


def check_known_name(name: str, where: str) -> None:
    """Raise `MethodError` if `name` is no quantity that can be known of a recording."""
    possible = (*KNOWN_CHANNELS, *LUMPED_PARAMETERS)
    if name not in possible:
        raise MethodError(f"{where}: unknown quantity '{name}'{nearest(name, possible)}; correct the name")
