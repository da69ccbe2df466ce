"""The verb `split`: cuts a long file into recordings."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from emaphm.cli.options import ActuatorFile, AsJson, By, Force, KnownList, RecordingFile, described_actuator
from emaphm.cli.output import show
from emaphm.errors import OutputError
from emaphm.input_files import exists

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.recording import Recording

DESCRIPTION = "actuator.toml"

HEADING = """\
Describes the recordings that `emaphm split` has written into this folder. Their columns have the names
and SI units of emaphm, so [channels] is not needed. They have already been cut and cleaned, so [reading]
does not request it again."""


def split(
    recording: RecordingFile,
    *,
    out: Annotated[Path, Parameter(name=["--out", "-o"], help="Folder for the recordings.")],
    by: By = None,
    actuator: ActuatorFile = "thesis",
    known: KnownList = (),
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Cut a long file into recordings, convert and clean them, and write each to a separate file.

    Without --by and without [reading] split in the TOML, the file is cut where time jumps or masks leave a
    gap. The folder also gets a description of the actuator with the names and units of the new files. With
    --force, recordings of the same file by an earlier run are replaced or removed.
    """
    from emaphm.cli.options import known_values
    from emaphm.recording import read_recordings
    from emaphm.recording.splitting import STRETCHES
    from emaphm.version import VERSION

    described = described_actuator(actuator)
    _check_description(actuator, out / DESCRIPTION)
    refused: list[str] = []
    recordings = read_recordings(
        recording,
        described,
        split=by or described.reading.split or STRETCHES,
        known=known_values(known),
        on_refused=refused.append,
    )
    files = _write(recordings, recording, out, force=force)
    _write_description(described, out / DESCRIPTION, force=force)
    summary: dict[str, Any] = {
        "recordings": [
            {
                "file": str(file),
                "samples": piece.samples,
                "duration_s": piece.duration_s,
                "labels": dict(piece.labels),
                "notes": list(piece.notes),
            }
            for file, piece in zip(files, recordings, strict=True)
        ],
        "refused": refused,
        "actuator": str(out / DESCRIPTION),
        "version": VERSION,
    }
    show(summary, _text(recordings, files, refused, out), as_json)


def _check_description(given: str, written: Path) -> None:
    """Refuse to overwrite the given description: it is needed to read the original file."""
    if exists(written, OutputError) and exists(Path(given), OutputError) and written.samefile(given):
        raise OutputError(
            f"{written}: is the description given with --actuator, which is needed to read the original "
            "file; choose another folder with --out"
        )


def _write(recordings: "list[Recording]", path: Path, out: Path, *, force: bool) -> list[Path]:
    """Write the recordings of the file `path` into the folder `out`; return their files.

    Those of an earlier run are removed, so that they are not read together with the new ones.
    """
    from emaphm.output_files import check_writable, make_folder, remove_earlier
    from emaphm.recording import write_recording

    ending = ".csv" if path.suffix.lower() == ".csv" else ".parquet"
    files = [
        out / f"{path.stem}_{_slug(recording, number)}{ending}"
        for number, recording in enumerate(recordings, 1)
    ]
    make_folder(out)
    for file in (*files, out / DESCRIPTION):
        check_writable(file, force=force, endings=(ending, ".toml"))
    earlier = _earlier_files(path, out)
    for file, recording in zip(files, recordings, strict=True):
        write_recording(recording, file, force=force)
    for file in earlier - set(files):
        remove_earlier(file)
    return files


def _earlier_files(path: Path, out: Path) -> set[Path]:
    """Return the recordings of the file `path` that an earlier run has written into the folder `out`.

    Only the description in the folder shows that its files with such names were written by this command.
    """
    try:
        described = (out / DESCRIPTION).read_text(encoding="utf-8", errors="replace")
        files = list(out.iterdir())
    except OSError:
        return set()
    if HEADING.splitlines()[0] not in described:
        return set()
    # A second number belongs to a recording of another file, e.g. log_0001.csv and not log.csv.
    name = re.compile(rf"{re.escape(path.stem)}_\d{{4,}}_(?!\d{{4,}}_).*\.(csv|parquet)")
    return {file for file in files if name.fullmatch(file.name) and file.is_file()}


def _slug(recording: "Recording", number: int) -> str:
    """Return the number and name of a recording, in characters that are valid in file names."""
    _, _, name = recording.source.rpartition(": ")
    name = name if recording.source.endswith(f": {name}") else ""
    return "_".join(filter(None, (f"{number:04d}", re.sub(r"[^\w.+-]+", "_", name).strip("_")[:80])))


def _write_description(actuator: "Actuator", path: Path, *, force: bool) -> None:
    from emaphm.actuator.channels import Channels
    from emaphm.actuator.reading import Reading
    from emaphm.output_files import check_writable

    check_writable(path, force=force, endings=(".toml",))
    standard_channels = Channels(
        sampling=actuator.channels.sampling, command_held=actuator.channels.command_held
    )
    # The first search has removed the outliers, if it was enabled: a second one would remove measured values.
    cleaned = Reading(outliers=False)
    changes = {"channels": standard_channels, "reading": cleaned}
    actuator.model_copy(update=changes).to_toml(path, comments=HEADING)


def _text(recordings: "list[Recording]", files: list[Path], refused: list[str], out: Path) -> str:
    """Return the table of the written files, with the pieces that were left out and the notes."""
    from emaphm.text_table import format_table

    rows = [
        (file.name, str(piece.samples), f"{piece.duration_s:.4g}", str(len(piece.notes)))
        for file, piece in zip(files, recordings, strict=True)
    ]
    table = format_table(("file", "rows", "duration [s]", "notes"), rows)
    left_out = [f"Left out: {reason}" for reason in refused]
    notes = dict.fromkeys(f"Note: {note}." for piece in recordings for note in piece.notes)
    last = f"Written to {out}; to read these files, give --actuator {out / DESCRIPTION}"
    return "\n".join([table, *left_out, *notes, last])
