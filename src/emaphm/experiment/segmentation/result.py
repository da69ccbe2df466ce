"""Result of a segmentation: each stretch with the components that it identifies, or why it is refused."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from emaphm.actuator import NAMES
from emaphm.errors import OutputError
from emaphm.experiment.segmentation.cells import stretch
from emaphm.input_files import exists
from emaphm.output_files import check_writable, make_folder, remove_earlier
from emaphm.recording import Recording, write_recording
from emaphm.text_table import NOTHING, format_table
from emaphm.version import VERSION


@dataclass(frozen=True)
class Segment:
    """A stretch of a recording: its rows and times, and the expected precision of each fault.

    `rows` are the first and the last (exclusive), `start_s` and `end_s` their times [s]. `half_widths` are
    the expected half-widths of 95 % intervals by component, without components that the actuator does not
    have. `identifies` are the components with the requested precision. `reason` says why a stretch is
    refused; it is empty if it is accepted.
    """

    rows: tuple[int, int]
    start_s: float
    end_s: float
    half_widths: Mapping[str, float]
    identifies: tuple[str, ...]
    reason: str = ""

    @property
    def accepted(self) -> bool:
        """Whether the stretch identifies at least one component."""
        return not self.reason

    def to_dict(self) -> dict[str, Any]:
        """Return the values of the stretch that `emaphm segment --json` prints."""
        return {
            "rows": list(self.rows),
            "start_s": self.start_s,
            "end_s": self.end_s,
            "accepted": self.accepted,
            "expected": dict(self.half_widths),
            "identifies": list(self.identifies),
            "reason": self.reason,
        }


@dataclass(frozen=True, eq=False)
class Segments:
    """All stretches of a `recording`, in order, accepted or refused; `wanted` is the requested half-width."""

    recording: Recording
    actuator: str
    stretches: tuple[Segment, ...]
    wanted: float
    seed: int

    @property
    def accepted(self) -> tuple[Segment, ...]:
        """The stretches that identify at least one component."""
        return tuple(segment for segment in self.stretches if segment.accepted)

    def recordings(self) -> list[Recording]:
        """Return the accepted stretches as recordings, with the times of the whole recording."""
        return [stretch(self.recording, *segment.rows) for segment in self.accepted]

    def write(self, folder: str | Path, *, force: bool = False) -> list[Path]:
        """Write the accepted stretches as stretch_001.csv, stretch_002.csv, …; return their paths.

        With `force`, files of an earlier run are replaced, and removed if there are fewer stretches now.

        Raises
        ------
        OutputError
            As in `check_folder`, or a file of an earlier run cannot be removed.
        """
        folder = Path(folder)
        check_folder(folder, force=force)
        paths = [_path(folder, number) for number in range(1, len(self.accepted) + 1)]
        for path, recording in zip(paths, self.recordings(), strict=True):
            write_recording(recording, path, force=force)
        for path in set(_earlier_files(folder)) - set(paths):
            remove_earlier(path)
        return paths

    def to_dict(self) -> dict[str, Any]:
        """Return the values that `emaphm segment --json` prints."""
        return {
            "recording": self.recording.source,
            "actuator": self.actuator,
            "wanted": self.wanted,
            "accepted": len(self.accepted),
            "segments": [segment.to_dict() for segment in self.stretches],
            "seed": self.seed,
            "version": VERSION,
        }

    def __str__(self) -> str:
        """Return a table of the accepted stretches, a table of the refused ones, and a summary."""
        used = sum(segment.end_s - segment.start_s for segment in self.accepted)
        summary = (
            f"{len(self.accepted)} of {len(self.stretches)} stretches identify something to "
            f"±{self.wanted:g}: {used:.4g} of {self.recording.duration_s:.4g} s."
        )
        return "\n\n".join(filter(None, (self._precision_table(), self._refusals_table(), summary)))

    def _precision_table(self) -> str:
        if not self.accepted:
            return ""
        names = [name for name in NAMES if any(name in segment.identifies for segment in self.accepted)]
        rows = [
            (
                _times(segment),
                *(
                    f"{segment.half_widths[name]:.2g}" if name in segment.identifies else NOTHING
                    for name in names
                ),
            )
            for segment in self.accepted
        ]
        title = (
            f"Expected half-width [-] of each fault's 95 % interval, where that is ±{self.wanted:g} or less:"
        )
        return f"{title}\n{format_table(('time [s]', *names), rows)}"

    def _refusals_table(self) -> str:
        rows = [(_times(segment), segment.reason) for segment in self.stretches if not segment.accepted]
        return format_table(("time [s]", "refused because"), rows) if rows else ""


def _times(segment: Segment) -> str:
    return f"{segment.start_s:.2f} to {segment.end_s:.2f}"


def check_folder(folder: str | Path, *, force: bool = False, source: Path | None = None) -> None:
    """Make a folder for stretches and check that they can be written; to be called before long work.

    Raises
    ------
    OutputError
        The folder cannot be made or written to, or has stretches already and `force` is not given, or the
        file `source`, which is to be cut, would be replaced or removed as one of them.
    """
    folder = Path(folder)
    make_folder(folder)
    for path in (_path(folder, 1), *_earlier_files(folder)):
        if source is not None and exists(path, OutputError) and path.samefile(source):
            raise OutputError(f"{path}: is the recording to be cut; choose another folder for its stretches")
        check_writable(path, force=force)


def _path(folder: Path, number: int) -> Path:
    return folder / f"stretch_{number:03d}.csv"


def _earlier_files(folder: Path) -> list[Path]:
    """Return the files of stretches in a folder."""
    return sorted(path for path in folder.glob("stretch_*.csv") if path.stem[len("stretch_") :].isdigit())
