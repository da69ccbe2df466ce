"""The result of a segmentation: each stretch with what it identifies, or why it is of no use."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from emaphm.experiment.segmentation.cells import stretch
from emaphm.output_files import check_writable, make_folder
from emaphm.recording import Recording, write_recording
from emaphm.text_table import format_table
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
        """Write the accepted stretches as stretch_001.csv and on; return their paths.

        Raises
        ------
        OutputError
            A file is there already and `force` is not given, or the folder cannot be written to.
        """
        folder = Path(folder)
        make_folder(folder)
        paths = [folder / f"stretch_{i + 1:03d}.csv" for i in range(len(self.accepted))]
        for path in paths:
            check_writable(path, force=force)
        for path, one in zip(paths, self.recordings(), strict=True):
            write_recording(one, path, force=force)
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
        """Return a table of the stretches, and a line on how many identify something."""
        rows = [
            (
                f"{one.start_s:.2f} to {one.end_s:.2f}",
                ", ".join(f"{name} ±{one.half_widths[name]:.2g}" for name in one.identifies) or "-",
                one.reason,
            )
            for one in self.stretches
        ]
        table = format_table(("time [s]", "identifies (expected half-width)", "refused because"), rows)
        used = sum(one.end_s - one.start_s for one in self.accepted)
        return (
            f"{table}\n\n{len(self.accepted)} of {len(self.stretches)} stretches identify something to "
            f"±{self.wanted:g}: {used:.4g} of {self.recording.duration_s:.4g} s."
        )
