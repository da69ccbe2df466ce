"""A campaign: recordings of one healthy unit, each with what is known of it beforehand."""

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
"""What may be known of a recording as one number where it was not recorded, and the channel it stands for:
the load at the motor [N·m], and the temperature of windings and magnets [K]."""


@dataclass(frozen=True, eq=False)
class CampaignRow:
    """One recording of a campaign.

    Attributes
    ----------
    recording
        Of the healthy unit.
    known
        Values that hold for this recording, in SI units: of a lumped parameter, of the `load` [N·m] or of the
        `temperature` [K].
    free
        Lumped parameters that are this recording's own: estimated for it alone. One that all recordings
        share too may deviate from the shared value in this recording.
    place
        Where the row stands, for errors: "campaign.csv, row 2".
    """

    recording: Recording
    known: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    free: tuple[str, ...] = ()
    place: str = ""

    @property
    def where(self) -> str:
        """What an error of this row begins with."""
        return self.place or self.recording.source

    @property
    def parameters(self) -> dict[str, float]:
        """The lumped parameters that are known, in their SI units."""
        return {name: value for name, value in self.known.items() if name not in KNOWN_CHANNELS}

    def completed(self) -> Recording:
        """Return the recording, with a channel of one value for a known load or temperature."""
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
        """Return the actuator with the parameters that are known here; the `shared` ones as described.

        Raises
        ------
        MethodError
            A value is impossible, such as a gain that is not positive.
        """
        if not self.parameters:
            return actuator
        kept = lumped_parameters(actuator, tuple(shared))
        try:
            return with_lumped_parameters(actuator, kept | self.parameters)
        except ActuatorError as error:
            reason = str(error).removeprefix(f"{actuator.name}: ")
            given = ", ".join(f"{name} = {value:g}" for name, value in self.parameters.items())
            raise MethodError(f"{self.where}: {given} cannot be: {reason}; correct the value") from None


Recordings: TypeAlias = Recording | CampaignRow | Sequence[Recording | CampaignRow]
"""What a calibration takes: one recording or several, each with or without what is known of it."""


def campaign_rows(recordings: Recordings) -> tuple[CampaignRow, ...]:
    """Return one row a recording."""
    given = (recordings,) if isinstance(recordings, Recording | CampaignRow) else tuple(recordings)
    rows = tuple(one if isinstance(one, CampaignRow) else CampaignRow(one) for one in given)
    for row in rows:
        check_recording(row.recording)
    return rows


def check_row(row: CampaignRow, actuator: Actuator, shared: Sequence[str]) -> None:
    """Refuse a row that contradicts itself, its recording, the actuator or the `shared` free parameters.

    Raises
    ------
    MethodError
        A name is unknown, or needs a section that the actuator lacks; a parameter is known and free; a load
        or temperature is given and recorded; a value is impossible.
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
    """Refuse a name that nothing known of a recording has."""
    possible = (*KNOWN_CHANNELS, *LUMPED_PARAMETERS)
    if name not in possible:
        raise MethodError(f"{where}: unknown quantity '{name}'{nearest(name, possible)}; correct the name")
