"""The verb that cuts a long file into recordings."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from emaphm.cli.options import ActuatorFile, AsJson, By, Force, KnownList, RecordingFile, described_actuator
from emaphm.cli.output import show
from emaphm.errors import OutputError

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.recording import Recording

DESCRIPTION = "actuator.toml"

HEADING = """\
Describes the recordings that `emaphm split` has written into this folder. Their columns have the names
and SI units of emaphm, so [channels] names none; they have been cut and cleaned, so [reading] does not
ask for it again."""


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
    """Cut a long file into recordings, convert and clean them, and write each to a file of its own.

    Where neither --by nor the TOML says by what, it is cut where time jumps or masks leave a hole. The folder
    gets the actuator's description too, for the names and units that the new files have.
    """
    from emaphm.cli.options import known_values
    from emaphm.recording import read_recordings
    from emaphm.recording.splitting import STRETCHES
    from emaphm.version import VERSION

    described = described_actuator(actuator)
    _check_description(actuator, out / DESCRIPTION)
    refused: list[str] = []
    found = read_recordings(
        recording,
        described,
        split=by or described.reading.split or STRETCHES,
        known=known_values(known),
        on_refused=refused.append,
    )
    files = _write(found, recording, out, force=force)
    _write_description(described, out / DESCRIPTION, force=force)
    summary: dict[str, Any] = {
        "recordings": [
            {
                "file": str(file),
                "samples": one.samples,
                "duration_s": one.duration_s,
                "labels": dict(one.labels),
                "notes": list(one.notes),
            }
            for file, one in zip(files, found, strict=True)
        ],
        "refused": refused,
        "actuator": str(out / DESCRIPTION),
        "version": VERSION,
    }
    show(summary, _text(found, files, refused, out), as_json)


def _check_description(given: str, written: Path) -> None:
    """Refuse to write over the description that was given: it says how the original is read."""
    if written.exists() and Path(given).exists() and written.samefile(given):
        raise OutputError(
            f"{written}: is the description that was given, which says how the original is read; choose "
            "another folder with --out"
        )


def _write(found: "list[Recording]", path: Path, out: Path, *, force: bool) -> list[Path]:
    from emaphm.output_files import check_writable, make_folder
    from emaphm.recording import write_recording

    ending = ".csv" if path.suffix.lower() == ".csv" else ".parquet"
    files = [out / f"{path.stem}_{_slug(one, number)}{ending}" for number, one in enumerate(found, 1)]
    make_folder(out)
    for file in (*files, out / DESCRIPTION):
        check_writable(file, force=force, endings=(ending, ".toml"))
    for file, one in zip(files, found, strict=True):
        write_recording(one, file, force=force)
    return files


def _slug(recording: "Recording", number: int) -> str:
    """Return the number of a recording and what it is called, in characters of file names."""
    _, _, name = recording.source.rpartition(": ")
    name = name if recording.source.endswith(f": {name}") else ""
    return "_".join(filter(None, (f"{number:04d}", re.sub(r"[^\w.+-]+", "_", name).strip("_")[:80])))


def _write_description(actuator: "Actuator", path: Path, *, force: bool) -> None:
    from emaphm.actuator.channels import Channels
    from emaphm.actuator.reading import Reading
    from emaphm.output_files import check_writable

    check_writable(path, force=force, endings=(".toml",))
    plain = Channels(sampling=actuator.channels.sampling)
    # What the first search for outliers has left, or was not to look for, is measured.
    cleaned = Reading(outliers=False)
    actuator.model_copy(update={"channels": plain, "reading": cleaned}).to_toml(path, comments=HEADING)


def _text(found: "list[Recording]", files: list[Path], refused: list[str], out: Path) -> str:
    from emaphm.text_table import format_table

    rows = [
        (file.name, str(one.samples), f"{one.duration_s:.4g}", str(len(one.notes)))
        for file, one in zip(files, found, strict=True)
    ]
    table = format_table(("file", "rows", "duration [s]", "notes"), rows)
    left_out = [f"Left out: {reason}" for reason in refused]
    notes = dict.fromkeys(f"Note: {note}." for one in found for note in one.notes)
    return "\n".join(
        [table, *left_out, *notes, f"Written to {out}; describe with --actuator {out / DESCRIPTION}"]
    )
