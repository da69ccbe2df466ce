"""Calibrating a healthy unit: its physical parameters, from one recording or several, and how well known."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.baseline import Baseline
from emaphm.actuator.lumped_parameters import TOTALS, check_totals, with_totals
from emaphm.actuator.quantity import unit_for
from emaphm.calibration.random_effects import combine
from emaphm.calibration.single_recording import estimate_unit, healthy_fit
from emaphm.errors import MethodError
from emaphm.estimation.bias_correction import MOST_TURNS
from emaphm.estimation.nuisances import NuisanceSet
from emaphm.estimation.objective import Fit
from emaphm.estimation.parameter_variation import Deviations, deviated, sizes
from emaphm.estimation.replay import Replay, replay
from emaphm.progress import subprogress
from emaphm.recording import Recording, check_plausible
from emaphm.text_table import format_table
from emaphm.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEAST_KNOWN = 0.5
"""A parameter with a larger relative standard error is called not identifiable."""

CALIBRATED = ", calibrated"
"""What the name of a calibrated actuator ends with."""


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

    `replays` has each recording beside the calibrated model, under the load, temperature and whatever else
    was found of that recording: its `nuisances`. `birge_ratio` is how much the recordings scatter, as a
    multiple of what their own standard errors say; none of one recording.
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
                    "nuisances": dict(found),
                }
                for one, found in zip(self.replays, self.nuisances, strict=True)
            ],
            "evaluations": self.evaluations,
            "seconds": round(self.seconds, 3),
            "seed": self.seed,
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
        told = "this recording" if len(self.replays) == 1 else "these recordings"
        rows = [
            (
                name,
                f"{p.value:.6g}",
                f"{p.standard_error:.2g}",
                p.unit if p.identifiable else f"{p.unit}  (not identifiable from {told})",
            )
            for name, p in self.parameters.items()
        ]
        table = format_table(("parameter", "value", "std. error", "unit"), rows)
        errors = [(name, f"{100 * error:.4g} %") for name, error in self.relative_error.items()]
        title = "relative error" if len(self.replays) == 1 else "largest relative error"
        return "\n\n".join([table, *self.notes(), format_table(("channel", title), errors)])

    def notes(self) -> list[str]:
        """Return a line on what was unknown of each recording, and one on how much the recordings scatter."""
        lines = [
            f"Estimated besides in {one.recording.source}: "
            + ", ".join(f"{name} {value:+.3g}" for name, value in found.items())
            + "."
            for one, found in zip(self.replays, self.nuisances, strict=True)
            if found
        ]
        if self.birge_ratio is not None:
            count = len(self.replays)
            lines.append(
                f"The {count} recordings scatter {self.birge_ratio:.2g} times as much as their own standard "
                "errors say"
                + ("; those above allow for it." if self.birge_ratio > 1 else ", no more than chance would.")
            )
        return ["\n".join(lines)] if lines else []


def calibrate(
    recordings: Recording | Sequence[Recording],
    actuator: Actuator,
    free: Sequence[str],
    *,
    nuisances: Sequence[str] | None = None,
    turns: int = MOST_TURNS,
    seed: int = 0,
    workers: int | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Calibration:
    """Return the parameters `free` of a healthy unit that explain `recordings`, and the calibrated actuator.

    Every channel counts that a diagnosis would compare. Each recording is explained by itself, its
    nuisances under their priors; what the recordings tell together, and how much they scatter, is the
    calibrated actuator's baseline, and so the prior of later diagnoses.

    Parameters
    ----------
    recordings
        Of the healthy unit; lengths, commands and channels may differ.
    actuator
        The description to start from; its values need only be right within a factor of 3 or so. A baseline
        of its own is replaced: what is known afterwards is what these recordings tell.
    free
        Names from `emaphm.actuator.lumped_parameters.TOTALS`; the others keep their values. Static friction
        keeps its ratio to dynamic friction unless it is free itself.
    nuisances
        What is unknown of each recording: as in `emaphm.diagnose`. One that a free parameter cannot be
        told from is left out: a load where `offset` is free.
    turns
        Most corrections of the model's bias by the reference model, as in `emaphm.diagnose`.
    seed
        Of the starting points.

    Raises
    ------
    MethodError
        There is no recording; no parameter, or an unknown one, is free; one needs a section that the
        actuator lacks, or starts at zero, where its size is not known; the actuator's baseline holds a
        parameter that is not free; or a nuisance is unknown or cannot be told from a free parameter.
    RecordingError
        A recording cannot be meant for this actuator, by orders of magnitude.
    """
    began = time.perf_counter()
    given = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    names = tuple(dict.fromkeys(free))
    _check(given, actuator, names)
    bare = actuator.model_copy(update={"baseline": None})
    unit = Deviations.free(bare, names)
    for recording in given:
        check_plausible(recording, bare)
    fits = [healthy_fit(recording, bare, unit, nuisances, workers) for recording in given]
    found = []
    for i, fit in enumerate(fits):
        tell = subprogress(on_progress, i / len(fits), (i + 1) / len(fits))
        found.append(estimate_unit(fit, turns, seed, tell))
    combined = combine(
        np.array([one.of(names)[0] for one in found]),
        np.array([one.of(names)[1] for one in found]),
        unit.priors,
    )
    days = tuple(one.nuisances_given(names, combined.mean) for one in found)
    size = sizes(bare, names)
    values = {
        name: float(deviated(bare, name, deviation))
        for name, deviation in zip(names, size * combined.mean, strict=True)
    }
    if "static" in values:
        # Below dynamic friction it has no effect, so the search may have left it anywhere there.
        values["static"] = max(values["static"], values.get("coulomb", bare.mechanics.dynamic_friction))
    calibrated = with_totals(bare, values, name=f"{actuator.name.removesuffix(CALIBRATED)}{CALIBRATED}")
    baseline = Baseline.of(
        names, np.outer(size, size) * combined.covariance, tuple(one.source for one in given)
    )
    errors = np.sqrt(np.diag(combined.covariance))
    return Calibration(
        {
            name: Parameter(
                value,
                float(error * (factor if name == "offset" else value)),
                unit_for(TOTALS[name], actuator.coordinates),
                identifiable=bool(error < LEAST_KNOWN),
            )
            for (name, value), error, factor in zip(values.items(), errors, size, strict=True)
        },
        calibrated.model_copy(update={"baseline": baseline}),
        tuple(_replayed(one, calibrated, day) for one, day in zip(fits, days, strict=True)),
        days,
        combined.birge_ratio,
        sum(one.evaluations for one in found),
        time.perf_counter() - began,
        seed,
    )


def _check(recordings: Sequence[Recording], actuator: Actuator, free: tuple[str, ...]) -> None:
    """Refuse what cannot be calibrated, before the work."""
    if not recordings:
        raise MethodError("no recording to calibrate from; give one of the healthy unit, or several")
    if not free:
        raise MethodError(f"no parameter to calibrate; name some of {', '.join(TOTALS)}")
    check_totals(actuator, free)
    for name in actuator.baseline.names if actuator.baseline else ():
        if name not in free:
            raise MethodError(
                f"actuator '{actuator.name}' has a baseline of '{name}', which calibrating without it "
                f"would lose; free '{name}' too, or start from the description before it was calibrated"
            )


def _replayed(fit: Fit, calibrated: Actuator, day: Mapping[str, float]) -> Replay:
    """Return the recording of `fit` replayed by the calibrated model as it was that `day`."""
    recording = fit.problem.recording
    unknown = NuisanceSet.of(calibrated, tuple(day), recording.names)
    values = {name: np.asarray(value) for name, value in day.items()}
    changed = unknown.totals(calibrated, values, fit.problem.warmer)
    totals = {name: float(value) for name, value in changed.items()}
    return replay(recording, with_totals(calibrated, totals) if totals else calibrated)
