"""The result of a calibration: a healthy unit's parameters, and its description with a baseline."""

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
        The calibrated description; its baseline has the parameters with their covariance.
    recordings
        What was found of each recording.
    birge_ratio
        Scatter of what the recordings would have alone, relative to that expected from their standard errors;
        None of one recording.
    scattered
        Whether that is more than chance; the standard errors of the parameters then include it.
    collinear_sets
        Parameters that are known in combination only.
    evaluations, seconds, seed
        Runs of models, the time that they took [s], and the source of the starting points.
    laws, selection
        Names of the laws that were added to the description, and how they were chosen.
    unexcited
        Laws that the recordings do not determine, each with the manoeuvre that would.
    loop
        Whether the fit was in closed loop or to the measured motion, and why.
    error_correlation
        From 0 to 1, how alike the residuals are of recordings that repeat a manoeuvre: what is common to them
        is not averaged away in the standard errors; None where no more than by chance.
    warnings
        Sentences on signs, units, channels that the calibrated model does not resemble, and what the
        recordings leave open all the same.
    law_notes
        Sentences on a law that was not chosen by the selection.
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
        """Each recording, replayed by the calibrated model."""
        return tuple(one.replay for one in self.recordings)

    @property
    def nuisances(self) -> tuple[Mapping[str, float], ...]:
        """What was estimated of each recording, each nuisance by its name, in its unit.

        `emaphm.estimation.space.nuisances.unit_of` returns the unit, such as N·m of a load.
        """
        return tuple(one.nuisances for one in self.recordings)

    @property
    def kept(self) -> Mapping[str, float]:
        """The parameters that were kept as described, none of them measured; in their units."""
        return kept_parameters(self.actuator, self.parameters)

    @property
    def relative_error(self) -> Mapping[str, float]:
        """The relative error of each channel, as a fraction: of the recording where it is largest."""
        worst: dict[str, float] = {}
        for one in self.replays:
            for name, error in one.relative_error.items():
                worst[name] = max(error, worst.get(name, 0.0))
        return worst

    @property
    def force_error(self) -> float | None:
        """The largest relative error of a torque by the measured motion; None in closed loop."""
        errors = [one.force_error for one in self.recordings if one.force_error is not None]
        return max(errors) if errors else None

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm calibrate --json` prints."""
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
            "collinear": [asdict(one) for one in self.collinear_sets],
            "laws": list(self.laws),
            "selection": [asdict(one) for one in self.selection],
            "law_notes": list(self.law_notes),
            "unexcited": dict(self.unexcited),
            "recordings": [
                {
                    "recording": one.replay.recording.source,
                    "relative_error": dict(one.replay.relative_error),
                    "nuisances": dict(one.nuisances),
                    "own": dict(one.own),
                    "known": dict(one.known),
                    "misfit_ratio": one.misfit_ratio,
                    "residual_over_noise": one.residual_over_noise,
                    "force_error": one.force_error,
                }
                for one in self.recordings
            ],
            "evaluations": self.evaluations,
            "seconds": round(self.seconds, 3),
            "seed": self.seed,
            "notes": [
                f"{one.recording.source}: {note}" for one in self.replays for note in one.recording.notes
            ],
            "warnings": list(self.warnings),
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
        """Return tables of the laws tried, of the parameters and of the relative errors."""
        parts = [law_table(self.selection)] if self.selection else []
        collinear = {name for one in self.collinear_sets for name in one.members}
        parts.append(parameter_table(self.parameters, collinear, len(self.recordings)))
        parts += ["\n".join(notes)] if (notes := self.notes()) else []
        errors = [(name, f"{100 * error:.4g} %") for name, error in self.relative_error.items()]
        if self.force_error is not None:
            errors.insert(0, ("torque by the measured motion", f"{100 * self.force_error:.4g} %"))
        title = "relative error" if len(self.replays) == 1 else "largest relative error"
        return "\n\n".join([*parts, format_table(("channel", title), errors)])

    def notes(self) -> list[str]:
        """Return what was done to the recordings, what is doubtful, each one's own, and warnings."""
        lines = [f"{self.loop}.", *self.law_notes]
        lines += [f"{one.recording.source}: {note}." for one in self.replays for note in one.recording.notes]
        lines += [f"{name} is {p.remark}." for name, p in self.parameters.items() if p.reason]
        lines += [str(one) for one in self.collinear_sets]
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
