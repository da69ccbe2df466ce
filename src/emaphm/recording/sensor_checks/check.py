"""All checks of sensors that need no model: what is spoilt is corrected or given up, and always named."""

from collections.abc import Container, Mapping
from dataclasses import dataclass

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.quantity import unit_for
from emaphm.arrays import Array
from emaphm.errors import RecordingError
from emaphm.recording.equivalent_current import MADE_OF, without_equivalent_current
from emaphm.recording.recording import Recording
from emaphm.recording.schema import CURRENTS, SCHEMA
from emaphm.recording.sensor_checks.clipping import clipped_rows
from emaphm.recording.sensor_checks.finding import SensorFinding
from emaphm.recording.sensor_checks.freezing import frozen_rows
from emaphm.recording.sensor_checks.held_samples import held_rows, interpolated
from emaphm.recording.sensor_checks.phases import phase_findings
from emaphm.recording.sensor_checks.resolution import Mask

CHECKED = (*CURRENTS, "angle_rad", "voltage_V", "voltage_d_V", "voltage_q_V", "position_rad", "speed_rad_s")
"""Channels whose sensors are checked: those that answer the command."""

MOST_UNUSABLE = 0.5
"""Share of spoilt rows beyond which a channel is left out as a whole."""


@dataclass(frozen=True, eq=False)
class CheckedRecording:
    """A recording after the checks of its sensors.

    `recording` has what could be corrected, with notes; `unusable` says of channels which rows (samples,)
    are not to be compared; `findings` is what was found.
    """

    recording: Recording
    unusable: Mapping[str, Mask]
    findings: tuple[SensorFinding, ...]


def check_sensors(recording: Recording, actuator: Actuator) -> CheckedRecording:
    """Return `recording` with the faults of its sensors found, and corrected where that is possible.

    Single rows that were held are interpolated. Frozen and clipped rows are not to be compared; a channel
    with more than `MOST_UNUSABLE` of them is left out. A phase with another scale is made of the other two,
    phases in each other's place are put right. A `current_A` that was made of the phases is not checked, and
    left out where something is found, to be made of what is left.

    Raises
    ------
    RecordingError
        The only channel that could be compared has too many spoilt rows.
    """
    given = recording
    recording = without_equivalent_current(recording, actuator)
    columns = dict(recording.channels)
    corrected, findings = phase_findings(recording, actuator)
    columns |= corrected
    unusable: dict[str, Mask] = {}
    for name in CHECKED:
        if name not in recording or np.ptp(columns[name]) == 0:
            continue
        spoilt, found = _spoilt_rows(columns[name], name, recording, actuator)
        findings += found
        if spoilt.any():
            unusable[name] = spoilt
        held = held_rows(columns[name]) & ~spoilt
        if held.any():
            columns[name] = interpolated(columns[name], held)
            findings.append(_held(name, held))
    if not findings:
        return CheckedRecording(given, {}, ())
    left_out = [name for name, rows in unusable.items() if rows.mean() > MOST_UNUSABLE]
    kept = {name: values for name, values in columns.items() if name not in left_out}
    _check_left(kept, recording, findings)
    notes = [finding.sentence for finding in findings]
    rows = {name: unusable[name] for name in unusable if name not in left_out}
    of_phases = [rows[name] for name in MADE_OF if name in rows]
    if of_phases and "current_A" not in recording:
        rows["current_A"] = np.any(of_phases, axis=0)
    return CheckedRecording(recording.with_channels(kept, notes), rows, tuple(findings))


def _spoilt_rows(
    values: Array, name: str, recording: Recording, actuator: Actuator
) -> tuple[Mask, list[SensorFinding]]:
    command = recording["command_rad"]
    unit = unit_for(SCHEMA[name].unit, actuator.coordinates)
    clipped = clipped_rows(values, name, command, actuator)
    # A long plateau of a clipped signal does not move either.
    frozen = frozen_rows(values, name, command, actuator) & ~clipped
    findings = []
    if frozen.any():
        seconds = float(frozen.sum()) * recording.interval_s
        sentence = (
            f"{name} is frozen for {seconds:.3g} s {_place(frozen)} while the command moves; these rows are "
            "not compared. Check the sensor and its line"
        )
        findings.append(SensorFinding(name, "frozen", seconds, "s", sentence, frozen))
    if clipped.any():
        level = float(np.max(np.abs(values[clipped])))
        sentence = (
            f"{name} is cut off at {level:.4g} {unit} in {int(clipped.sum())} rows {_place(clipped)}; these "
            "rows are not compared. Give the sensor or its converter a larger range"
        )
        findings.append(SensorFinding(name, "clipped", level, unit, sentence, clipped))
    return frozen | clipped, findings


def _held(name: str, held: Mask) -> SensorFinding:
    count = int(held.sum())
    sentence = (
        f"{name} repeats the value of the row before in {count} rows {_place(held)} although it moves: lost "
        "samples, which were interpolated. Check the logger's rate and its bus"
    )
    return SensorFinding(name, "held", float(count), "rows", sentence, held)


def _place(rows: Mask) -> str:
    where = np.flatnonzero(rows)
    return f"(between row {where[0] + 1} and row {where[-1] + 1})"


def _check_left(kept: Mapping[str, Array], recording: Recording, findings: list[SensorFinding]) -> None:
    """Refuse a recording that nothing is left of."""
    ways = (("current_A",), ("current_q_A",), MADE_OF)

    def measured(columns: Container[str]) -> bool:
        return any(all(name in columns for name in way) for way in ways)

    if measured(recording) and not measured(kept):
        raise RecordingError(
            f"{recording.source}: {findings[0].sentence}; too little of the current is left to diagnose, "
            "record it again"
        )
