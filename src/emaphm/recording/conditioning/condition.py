"""Conditioning of the rows of one recording: gaps, outliers and delays; each step adds a note."""

from collections.abc import Collection, Mapping

from emaphm.actuator.channels import Sampling
from emaphm.actuator.reading import Reading
from emaphm.arrays import Array
from emaphm.recording.checks import check, check_values
from emaphm.recording.conditioning.delays import without_delays
from emaphm.recording.conditioning.gaps import with_lost_rows, with_zeros_in_short_gaps, without_short_gaps
from emaphm.recording.conditioning.outliers import without_outliers


def conditioned(
    channels: Mapping[str, Array],
    constants: Collection[str],
    delays: Mapping[str, float],
    reading: Reading,
    sampling: Sampling,
    names: Mapping[str, str],
    source: str,
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return the channels of a recording without short gaps, outliers and delays, and a note on each step.

    Channels that need no conditioning are returned bit for bit. Columns beyond the schema lose and gain the
    same rows as the channels, and are not changed otherwise.

    Parameters
    ----------
    channels
        Arrays (n,) by name, NaN where a cell is empty.
    constants
        Channels that were not measured.
    delays
        Delays with which channels were recorded, by name [s].
    reading
        Longest gap, and whether outliers are replaced.
    sampling
        Meaning of a row: "mean" or "instant".
    names
        Names of the channels in the file.
    source
        Name of the recording, for errors.

    Raises
    ------
    RecordingError
        There is a long gap, the columns do not pass `check`, or a delay is longer than the recording.
    """
    # The rows that a message names are those given, before rows are left out or added.
    check_values(with_zeros_in_short_gaps(channels, reading.longest_gap), source, names)
    columns, lost = with_lost_rows(dict(channels), reading.longest_gap)
    columns, filled = without_short_gaps(columns, reading.longest_gap)
    check(columns, source, names)
    columns, replaced = without_outliers(columns, constants) if reading.outliers else (columns, ())
    columns, shifted = without_delays(columns, delays, sampling, source)
    return columns, (*lost, *filled, *replaced, *shifted)
