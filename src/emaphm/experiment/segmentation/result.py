"""The result of a segmentation: each stretch with what it identifies, or why it is of no use."""

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
    """A stretch of a recording: its rows and times, and the expected precision of each fault.

    `rows` are the first and the last (exclusive), `start_s` and `end_s` their times [s]. `half_widths` are
    the expected half-widths of 95 % intervals by component, without those that the actuator cannot show;
    `identifies` those that become known as well as was asked. `reason` says why a stretch is refused; it is
    empty where the stretch identifies something.
    """

    rows: tuple[int, int]
    start_s: float
    end_s: float
    half_widths: Mapping[str, float]
    identifies: tuple[str, ...]
    reason: str = ""

    @property
    def accepted(self) -> bool:
        """Whether the stretch identifies something."""
        return not self.reason

    def to_dict(self) -> dict[str, Any]:
        """Return the stretch as `emaphm segment --json` prints it."""
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
    """All stretches of a `recording`, in order, accepted or refused; `wanted` is the half-width asked for."""

    recording: Recording
    actuator: str
    stretches: tuple[Segment, ...]
    wanted: float
    seed: int

    @property
    def accepted(self) -> tuple[Segment, ...]:
        """The stretches that identify something."""
        return tuple(one for one in self.stretches if one.accepted)

    def recordings(self) -> list[Recording]:
        """Return the accepted stretches as recordings, their times those of the whole."""
        return [stretch(self.recording, *one.rows) for one in self.accepted]

    def write(self, folder: str | Path, *, force: bool = False) -> list[Path]:
        """Write the accepted stretches as stretch_001.csv and on, and no others; return their paths.

        With `force`, those of an earlier run are replaced, and removed where there are fewer now.

        Raises
        ------
        OutputError
            As `check_folder`, or an earlier stretch cannot be removed.
        """
        folder = Path(folder)
        check_folder(folder, force=force)
        paths = [_path(folder, number) for number in range(1, len(self.accepted) + 1)]
        for path, one in zip(paths, self.recordings(), strict=True):
            write_recording(one, path, force=force)
        for path in set(_earlier(folder)) - set(paths):
            _remove(path)
        return paths

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm segment --json` prints."""
        return {
            "recording": self.recording.source,
            "actuator": self.actuator,
            "wanted": self.wanted,
            "accepted": len(self.accepted),
            "segments": [one.to_dict() for one in self.stretches],
            "seed": self.seed,
            "version": VERSION,
        }

    def __str__(self) -> str:
        """Return a table of what identifies something, one of what is refused, and how much that is."""
        used = sum(one.end_s - one.start_s for one in self.accepted)
        summary = (
            f"{len(self.accepted)} of {len(self.stretches)} stretches identify something to "
            f"±{self.wanted:g}: {used:.4g} of {self.recording.duration_s:.4g} s."
        )
        return "\n\n".join(filter(None, (self._precision(), self._refusals(), summary)))

    def _precision(self) -> str:
        if not self.accepted:
            return ""
        names = [name for name in NAMES if any(name in one.identifies for one in self.accepted)]
        rows = [
            (
                _times(one),
                *(f"{one.half_widths[name]:.2g}" if name in one.identifies else NOTHING for name in names),
            )
            for one in self.accepted
        ]
        title = (
            f"Expected half-width [-] of each fault's 95 % interval, where that is ±{self.wanted:g} or less:"
        )
        return f"{title}\n{format_table(('time [s]', *names), rows)}"

    def _refusals(self) -> str:
        rows = [(_times(one), one.reason) for one in self.stretches if not one.accepted]
        return format_table(("time [s]", "refused because"), rows) if rows else ""


def _times(one: Segment) -> str:
    return f"{one.start_s:.2f} to {one.end_s:.2f}"


def check_folder(folder: str | Path, *, force: bool = False) -> None:
    """Make a folder for stretches, or refuse it; to be called before long work.

    Raises
    ------
    OutputError
        The folder cannot be made or written to, or has stretches already and `force` is not given.
    """
    folder = Path(folder)
    make_folder(folder)
    for path in (_path(folder, 1), *_earlier(folder)):
        check_writable(path, force=force)


def _path(folder: Path, number: int) -> Path:
    return folder / f"stretch_{number:03d}.csv"


def _earlier(folder: Path) -> list[Path]:
    """Return the stretches that are in a folder."""
    return sorted(path for path in folder.glob("stretch_*.csv") if path.stem[len("stretch_") :].isdigit())


def _remove(path: Path) -> None:
    try:
        path.unlink()
    except OSError as error:
        raise OutputError(
            f"{path}: of an earlier run, cannot be removed ({error.strerror or error}); remove it, or give "
            "another folder"
        ) from None
