"""Result of a calibration: parameters of a healthy unit, and its description with a baseline."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import LUMPED_PARAMETERS, kept_parameters
from emaphm.actuator.quantity import unit_for
from emaphm.calibration.findings import Parameter, RecordingResult
from emaphm.calibration.law_selection import LawTrial
from emaphm.calibration.motion.loop import CLOSED, LoopChoice
from emaphm.calibration.separation import CollinearParameters
from emaphm.calibration.text import kept_notes, law_table, model_error_notes, parameter_table, recording_notes
from emaphm.estimation.replay import Replay
from emaphm.text_table import format_table
from emaphm.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Calibration:
    """Parameters of a healthy unit, and its calibrated description.

    Attributes
    ----------
    parameters
        By name: value and standard error in the parameter's unit, and whether it is identifiable.
    actuator
        Calibrated description; its baseline contains the parameters with their covariance.
    recordings
        Result for each recording.
    birge_ratio
        Scatter of the estimates of the recordings alone, relative to that expected from their standard
        errors; None for one recording.
    scattered
        Whether this scatter exceeds chance; the standard errors of the parameters then include it.
    collinear_sets
        Sets of parameters of which only a combination is known.
    evaluations, seconds, seed
        Number of model runs, duration [s], and seed of the starting points.
    laws, selection
        Names of the laws that were added to the description, and the trials of their selection.
    unexcited
        Laws that the recordings do not identify, each with a manoeuvre that would.
    loop
        Whether the fit was in closed loop or by measured motion, and the reason.
    error_correlation
        Correlation, from 0 to 1, of the residuals of recordings that repeat a manoeuvre; the standard errors
        do not average away the common part. None if it does not exceed chance.
    warnings
        Sentences on signs, units, channels that the calibrated model does not resemble, and parameters that
        the recordings leave open.
    law_notes
        Sentences on a law that was added without the selection.
    """

    parameters: Mapping[str, Parameter]
    actuator: Actuator
    recordings: tuple[RecordingResult, ...]
    birge_ratio: float | None
    scattered: bool
    collinear_sets: tuple[CollinearParameters, ...]
    evaluations: int
    seconds: float
    seed: int
    laws: tuple[str, ...] = ()
    selection: tuple[LawTrial, ...] = ()
    unexcited: Mapping[str, str] = field(default_factory=dict)
    loop: LoopChoice = CLOSED
    error_correlation: float | None = None
    warnings: tuple[str, ...] = ()
    law_notes: tuple[str, ...] = ()

    @property
    def replays(self) -> tuple[Replay, ...]:
        """Replay of each recording by the calibrated model."""
        return tuple(result.replay for result in self.recordings)

    @property
    def nuisances(self) -> tuple[Mapping[str, float], ...]:
        """Estimated nuisances of each recording by name, in their units.

        `emaphm.estimation.space.nuisances.unit_of` returns the unit, such as N·m for a load.
        """
        return tuple(result.nuisances for result in self.recordings)

    @property
    def kept(self) -> Mapping[str, float]:
        """Parameters that were kept as described, not estimated; in their units."""
        return kept_parameters(self.actuator, self.parameters)

    @property
    def relative_error(self) -> Mapping[str, float]:
        """Largest relative error of each channel over the recordings, as a fraction."""
        worst: dict[str, float] = {}
        for replay in self.replays:
            for name, error in replay.relative_error.items():
                worst[name] = max(error, worst.get(name, 0.0))
        return worst

    @property
    def force_error(self) -> float | None:
        """Largest relative error of the torque by measured motion; None in closed loop."""
        errors = [result.force_error for result in self.recordings if result.force_error is not None]
        return max(errors) if errors else None

    def to_dict(self) -> dict[str, Any]:
        """Return the output of `emaphm calibrate --json`."""
        return {
            "parameters": {name: asdict(p) for name, p in self.parameters.items()},
            "kept": {
                name: {"value": value, "unit": unit_for(LUMPED_PARAMETERS[name], self.actuator.coordinates)}
                for name, value in self.kept.items()
            },
            "loop": self.loop.loop,
            "loop_reason": self.loop.reason,
            "relative_error": dict(self.relative_error),
            "force_error": self.force_error,
            "model_error": self.actuator.model_error.model_dump(mode="json", exclude_none=True),
            "birge_ratio": self.birge_ratio,
            "scattered": self.scattered,
            "error_correlation": self.error_correlation,
            "collinear": [asdict(collinear) for collinear in self.collinear_sets],
            "laws": list(self.laws),
            "selection": [asdict(trial) for trial in self.selection],
            "law_notes": list(self.law_notes),
            "unexcited": dict(self.unexcited),
            "recordings": [
                {
                    "recording": result.replay.recording.source,
                    "relative_error": dict(result.replay.relative_error),
                    "nuisances": dict(result.nuisances),
                    "own": dict(result.own),
                    "known": dict(result.known),
                    "misfit_ratio": result.misfit_ratio,
                    "residual_over_noise": result.residual_over_noise,
                    "force_error": result.force_error,
                }
                for result in self.recordings
            ],
            "evaluations": self.evaluations,
            "seconds": round(self.seconds, 3),
            "seed": self.seed,
            "notes": [
                f"{replay.recording.source}: {note}"
                for replay in self.replays
                for note in replay.recording.notes
            ],
            "warnings": list(self.warnings),
            "actuator": self.actuator.name,
            "version": VERSION,
        }

    def to_json(self) -> str:
        """Return the calibration as JSON."""
        return json.dumps(self.to_dict(), indent=2)

    def plot(self) -> "Figure":
        """Draw measured and modelled channels with residuals, for the recording with the largest error."""
        return max(self.replays, key=lambda replay: replay.relative_error.get("current_A", 0.0)).plot()

    def __str__(self) -> str:
        """Return tables of the tried laws, the parameters and the relative errors."""
        parts = [law_table(self.selection)] if self.selection else []
        collinear = {name for collinear_set in self.collinear_sets for name in collinear_set.members}
        parts.append(parameter_table(self.parameters, collinear, len(self.recordings)))
        parts += ["\n".join(notes)] if (notes := self.notes()) else []
        errors = [(name, f"{100 * error:.4g} %") for name, error in self.relative_error.items()]
        if self.force_error is not None:
            errors.insert(0, ("torque by the measured motion", f"{100 * self.force_error:.4g} %"))
        title = "relative error" if len(self.replays) == 1 else "largest relative error"
        return "\n\n".join([*parts, format_table(("channel", title), errors)])

    def notes(self) -> list[str]:
        """Return sentences on the loop, the recordings, doubtful and own parameters, and warnings."""
        lines = [f"{self.loop}.", *self.law_notes]
        lines += [
            f"{replay.recording.source}: {note}."
            for replay in self.replays
            for note in replay.recording.notes
        ]
        lines += [f"{name} is {p.remark}." for name, p in self.parameters.items() if p.reason]
        lines += [str(collinear) for collinear in self.collinear_sets]
        lines += [
            f"These recordings do not determine the law '{name}'; {manoeuvre} would."
            for name, manoeuvre in self.unexcited.items()
        ]
        lines += recording_notes(self.recordings, self.birge_ratio, self.scattered, self.error_correlation)
        lines += kept_notes(self.kept, self.actuator.coordinates, self.parameters)
        lines += model_error_notes(
            self.actuator.model_error, self.actuator.coordinates, laws_tried=bool(self.selection)
        )
        return [*lines, *(f"Warning: {warning}." for warning in self.warnings)]
