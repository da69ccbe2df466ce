"""All sensor checks that need no model; each fault is corrected or excluded, and noted."""

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
from emaphm.recording.sensor_checks.command_noise import COMMAND, smoothed_command
from emaphm.recording.sensor_checks.finding import SensorFinding
from emaphm.recording.sensor_checks.freezing import frozen_rows
from emaphm.recording.sensor_checks.held_samples import held_rows, interpolated
from emaphm.recording.sensor_checks.phases import phase_findings
from emaphm.recording.sensor_checks.resolution import Mask

CHECKED = (*CURRENTS, "angle_rad", "voltage_V", "voltage_d_V", "voltage_q_V", "position_rad", "speed_rad_s")
"""Channels whose sensors are checked: the responses to the command."""

MOST_UNUSABLE = 0.5
"""Largest share of unusable rows; beyond it the whole channel is left out."""


@dataclass(frozen=True, eq=False)
class CheckedRecording:
    """A recording after the sensor checks.

    `recording` contains the corrected channels, with notes; `unusable` gives by channel whether each row
    (samples,) must be excluded from the comparison with a model; `findings` lists the sensor faults.
    """

    recording: Recording
    unusable: Mapping[str, Mask]
    findings: tuple[SensorFinding, ...]


def check_sensors(recording: Recording, actuator: Actuator) -> CheckedRecording:
    """Return `recording` with its sensor faults detected, and corrected if possible.

    Single held rows are interpolated. Frozen and clipped rows are marked as unusable; a channel with more
    than `MOST_UNUSABLE` of them is left out. A phase current with a wrong scale is computed from the other
    two, swapped phases are exchanged. A command with noise that the drive did not receive is smoothed. A
    `current_A` that was computed from the phases is not checked; after any finding it is left out, so that
    it is computed again from the corrected channels.

    Raises
    ------
    RecordingError
        No current is left, because its channels have too many unusable rows.
    """
    original = recording
    recording = without_equivalent_current(recording, actuator)
    columns = dict(recording.channels)
    corrected, findings = phase_findings(recording, actuator)
    columns |= corrected
    unusable: dict[str, Mask] = {}
    for name in CHECKED:
        if name not in recording or np.ptp(columns[name]) == 0:
            continue
        unusable_rows, channel_findings = _unusable_rows(columns[name], name, recording, actuator)
        findings += channel_findings
        if unusable_rows.any():
            unusable[name] = unusable_rows
        held = held_rows(columns[name]) & ~unusable_rows
        if held.any():
            columns[name] = interpolated(columns[name], held)
            findings.append(_held_finding(name, held))
    smooth = smoothed_command(original, actuator)
    if smooth is not None:
        columns[COMMAND], finding = smooth
        findings.append(finding)
    if not findings:
        return CheckedRecording(original, {}, ())
    left_out = [name for name, rows in unusable.items() if rows.mean() > MOST_UNUSABLE]
    kept = {name: values for name, values in columns.items() if name not in left_out}
    _check_current_left(kept, recording, findings)
    notes = [finding.sentence for finding in findings]
    rows = {name: unusable[name] for name in unusable if name not in left_out}
    phase_rows = [rows[name] for name in MADE_OF if name in rows]
    if phase_rows and "current_A" not in recording:
        rows["current_A"] = np.any(phase_rows, axis=0)
    return CheckedRecording(recording.with_channels(kept, notes), rows, tuple(findings))


def _unusable_rows(
    values: Array, name: str, recording: Recording, actuator: Actuator
) -> tuple[Mask, list[SensorFinding]]:
    """Return whether each row (n,) of a channel is frozen or clipped, and the findings on it."""
    command = recording["command_rad"]
    unit = unit_for(SCHEMA[name].unit, actuator.coordinates)
    clipped = clipped_rows(values, name, command, actuator)
    # A long plateau of a clipped signal is not a frozen sensor.
    frozen = frozen_rows(values, name, command, actuator) & ~clipped
    findings = []
    if frozen.any():
        seconds = float(frozen.sum()) * recording.interval_s
        sentence = (
            f"{name} is frozen for {seconds:.3g} s {_place(frozen)} while the command moves; these rows are "
            "not compared. Check the sensor and its line"
        )
        findings.append(SensorFinding(name, "frozen", seconds, "s", sentence))
    if clipped.any():
        level = float(np.max(np.abs(values[clipped])))
        sentence = (
            f"{name} is cut off at {level:.4g} {unit} in {int(clipped.sum())} rows {_place(clipped)}; these "
            "rows are not compared. Give the sensor or its converter a larger range"
        )
        findings.append(SensorFinding(name, "clipped", level, unit, sentence))
    return frozen | clipped, findings


def _held_finding(name: str, held: Mask) -> SensorFinding:
    count = int(held.sum())
    sentence = (
        f"{name} repeats the value of the row before in {count} rows {_place(held)} although it moves: lost "
        "samples, which were interpolated. Check the logger's rate and its bus"
    )
    return SensorFinding(name, "held", float(count), "rows", sentence)


def _place(rows: Mask) -> str:
    indices = np.flatnonzero(rows)
    return f"(between row {indices[0] + 1} and row {indices[-1] + 1})"


def _check_current_left(
    kept: Mapping[str, Array], recording: Recording, findings: list[SensorFinding]
) -> None:
    """Refuse a recording in which no current is left after the checks."""
    alternatives = (("current_A",), ("current_q_A",), MADE_OF)

    def has_current(columns: Container[str]) -> bool:
        return any(all(name in columns for name in channels) for channels in alternatives)

    if has_current(recording) and not has_current(kept):
        raise RecordingError(
            f"{recording.source}: {findings[0].sentence}; too little of the current is left to diagnose, "
            "record it again"
        )
