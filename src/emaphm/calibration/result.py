"""The result of a calibration: a healthy unit's parameters, and its description with a baseline."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from emaphm.actuator import Actuator
from emaphm.estimation.replay import Replay
from emaphm.text_table import format_table
from emaphm.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Parameter:
    """One calibrated parameter with its standard error, both in `unit`."""

    value: float
    standard_error: float
    unit: str
    identifiable: bool


@dataclass(frozen=True, eq=False)
class Calibration:
    """Parameters of a healthy unit, and the calibrated `actuator` with its baseline.

    `replays` compares each recording with the calibrated model, under the load, temperature and whatever else
    was estimated of that recording: its `nuisances`. `birge_ratio` is the scatter between the recordings
    relative to that expected from their standard errors; None of one recording.
    """

    parameters: Mapping[str, Parameter]
    actuator: Actuator
    replays: tuple[Replay, ...]
    nuisances: tuple[Mapping[str, float], ...]
    birge_ratio: float | None
    evaluations: int
    seconds: float
    seed: int

    @property
    def relative_error(self) -> Mapping[str, float]:
        """The relative error of each channel, as a fraction: of the recording where it is largest."""
        worst: dict[str, float] = {}
        for one in self.replays:
            for name, error in one.relative_error.items():
                worst[name] = max(error, worst.get(name, 0.0))
        return worst

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm calibrate --json` prints."""
        return {
            "parameters": {
                name: {
                    "value": p.value,
                    "standard_error": p.standard_error,
                    "unit": p.unit,
                    "identifiable": p.identifiable,
                }
                for name, p in self.parameters.items()
            },
            "relative_error": dict(self.relative_error),
            "birge_ratio": self.birge_ratio,
            "recordings": [
                {
                    "recording": one.recording.source,
                    "relative_error": dict(one.relative_error),
                    "nuisances": dict(values),
                }
                for one, values in zip(self.replays, self.nuisances, strict=True)
            ],
            "evaluations": self.evaluations,
            "seconds": round(self.seconds, 3),
            "seed": self.seed,
            "notes": [
                f"{one.recording.source}: {note}" for one in self.replays for note in one.recording.notes
            ],
            "actuator": self.actuator.name,
            "version": VERSION,
        }

    def to_json(self) -> str:
        """Return the calibration as JSON."""
        return json.dumps(self.to_dict(), indent=2)

    def plot(self) -> "Figure":
        """Draw each channel, measured against model, with its residual: of the recording replayed worst."""
        return max(self.replays, key=lambda one: one.relative_error.get("current_A", 0.0)).plot()

    def __str__(self) -> str:
        """Return tables of the parameters and of the relative errors."""
        source = "this recording" if len(self.replays) == 1 else "these recordings"
        rows = [
            (
                name,
                f"{p.value:.6g}",
                f"{p.standard_error:.2g}",
                p.unit if p.identifiable else f"{p.unit}  (not identifiable from {source})",
            )
            for name, p in self.parameters.items()
        ]
        table = format_table(("parameter", "value", "std. error", "unit"), rows)
        errors = [(name, f"{100 * error:.4g} %") for name, error in self.relative_error.items()]
        title = "relative error" if len(self.replays) == 1 else "largest relative error"
        return "\n\n".join([table, *self.notes(), format_table(("channel", title), errors)])

    def notes(self) -> list[str]:
        """Return what was done to the recordings, the nuisances of each, and the scatter between them."""
        lines = [f"{one.recording.source}: {note}." for one in self.replays for note in one.recording.notes]
        lines += [
            f"Estimated with the parameters in {one.recording.source}: "
            + ", ".join(f"{name} {value:+.3g}" for name, value in values.items())
            + "."
            for one, values in zip(self.replays, self.nuisances, strict=True)
            if values
        ]
        if self.birge_ratio is not None:
            count = len(self.replays)
            lines.append(
                f"The {count} recordings scatter {self.birge_ratio:.2g} times as much as their own standard "
                "errors explain"
                + ("; those above include it." if self.birge_ratio > 1 else ", no more than by chance.")
            )
        return ["\n".join(lines)] if lines else []
