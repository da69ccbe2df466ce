"""Result of a segmentation: each stretch with the faults that it identifies, or the reason of its refusal."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from emaphm.actuator import NAMES
from emaphm.errors import OutputError
from emaphm.experiment.segmentation.cells import stretch
from emaphm.output_files import check_writable, make_folder
from emaphm.recording import Recording, write_recording
from emaphm.text_table import NOTHING, format_table
from emaphm.version import VERSION


@dataclass(frozen=True)
class Segment:
    """Stretch of a recording: its rows and times, and the expected precision of each fault.

    `rows` are the first and the last row (exclusive), `start_s` and `end_s` their times [s]. `half_widths`
    are the expected half-widths of 95 % intervals by component, without components that the actuator lacks;
    `identifies` are the components with at most the requested half-width. `reason` is the reason for a
    refusal; it is empty for an accepted stretch.
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
        """Return the stretch in the form of `emaphm segment --json`."""
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
    """All stretches of a `recording` in order, accepted or refused; `wanted` is the requested half-width."""

    recording: Recording
    actuator: str
    stretches: tuple[Segment, ...]
    wanted: float
    seed: int

    @property
    def accepted(self) -> tuple[Segment, ...]:
        """Accepted stretches, which identify at least one component."""
        return tuple(segment for segment in self.stretches if segment.accepted)

    def recordings(self) -> list[Recording]:
        """Return the accepted stretches as recordings, with the times of the original recording."""
        return [stretch(self.recording, *segment.rows) for segment in self.accepted]

    def write(self, folder: str | Path, *, force: bool = False) -> list[Path]:
        """Write the accepted stretches as stretch_001.csv, stretch_002.csv, …; return their paths.

        With `force`, stretches of an earlier run are replaced, and surplus stretches are removed.

        Raises
        ------
        OutputError
            As `check_folder`, or an earlier stretch cannot be removed.
        """
        folder = Path(folder)
        check_folder(folder, force=force)
        paths = [_path(folder, number) for number in range(1, len(self.accepted) + 1)]
        for path, recording in zip(paths, self.recordings(), strict=True):
            write_recording(recording, path, force=force)
        for path in set(_earlier(folder)) - set(paths):
            _remove(path)
        return paths

    def to_dict(self) -> dict[str, Any]:
        """Return the output of `emaphm segment --json`."""
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
        """Return a table of accepted stretches, a table of refused stretches, and a summary."""
        used = sum(segment.end_s - segment.start_s for segment in self.accepted)
        summary = (
            f"{len(self.accepted)} of {len(self.stretches)} stretches identify something to "
            f"±{self.wanted:g}: {used:.4g} of {self.recording.duration_s:.4g} s."
        )
        return "\n\n".join(filter(None, (self._precision(), self._refusals(), summary)))

    def _precision(self) -> str:
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
        title = f"Expected half-width [-] of each fault's 95 % interval, if it is ±{self.wanted:g} or less:"
        return f"{title}\n{format_table(('time [s]', *names), rows)}"

    def _refusals(self) -> str:
        rows = [(_times(segment), segment.reason) for segment in self.stretches if not segment.accepted]
        return format_table(("time [s]", "refused because"), rows) if rows else ""


def _times(segment: Segment) -> str:
    return f"{segment.start_s:.2f} to {segment.end_s:.2f}"


def check_folder(folder: str | Path, *, force: bool = False) -> None:
    """Make a folder for stretches and check it; to be called before long work.

    Raises
    ------
    OutputError
        The folder cannot be made or written to, or already contains stretches and `force` is not given.
    """
    folder = Path(folder)
    make_folder(folder)
    for path in (_path(folder, 1), *_earlier(folder)):
        check_writable(path, force=force)


def _path(folder: Path, number: int) -> Path:
    return folder / f"stretch_{number:03d}.csv"


def _earlier(folder: Path) -> list[Path]:
    """Return the paths of the stretches in a folder."""
    return sorted(path for path in folder.glob("stretch_*.csv") if path.stem[len("stretch_") :].isdigit())


def _remove(path: Path) -> None:
    try:
        path.unlink()
    except OSError as error:
        raise OutputError(
            f"{path}: this file of an earlier run cannot be removed ({error.strerror or error}); remove it, "
            "or give another folder"
        ) from None
