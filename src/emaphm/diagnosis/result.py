"""What a diagnosis is: the faults found, how sure each is, and how it was computed."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.arrays import Array
from emaphm.diagnosis.wording import physical_text
from emaphm.estimation.collinearity import Group
from emaphm.estimation.nuisances import BASELINE
from emaphm.text_table import format_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from emaphm.estimation.posterior import Posterior


@dataclass(frozen=True)
class Estimate:
    """One fault component: its normalised value, standard error, 95 % interval and verdict.

    The verdict is "degraded" where the whole interval is away from the healthy value, "healthy" where it
    leaves room for no fault that matters, else "cannot tell". `identifiable` is false where the data leave
    half the range open or more. `reason` says why nothing can be told. The interval of the eccentricity's
    phase may run past 0 or 1, where the circle closes.
    """

    value: float
    standard_error: float
    interval95: tuple[float, float]
    identifiable: bool
    verdict: Literal["healthy", "degraded", "cannot tell"]
    reason: str = ""


@dataclass(frozen=True)
class NuisanceEstimate:
    """What was estimated with the faults: a value and its standard error in `unit`.

    `known` is false where the channels tell next to nothing of it, so that its prior is all there is.
    """

    value: float
    standard_error: float
    unit: str
    known: bool

    def __str__(self) -> str:
        """Return the value with its standard error and unit."""
        unit = "" if self.unit == "-" else f" {self.unit}"
        # Both to the second digit of the error.
        digits = max(0, 1 - math.floor(math.log10(max(self.standard_error, 1e-12))))
        return f"{self.value:+.{digits}f} ± {self.standard_error:.{digits}f}{unit}"


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The faults that explain a recording.

    `components` has the eight of `Faults` in order; `covariance` (d, d) is in estimator coordinates, whose
    names are `coordinates`. `fitness` is the method's own measure, `residual_rms_A` the rms of recorded
    less modelled current; `explained` is false where that is more than the model can answer for.
    `recorded`, `modelled` [A] and `time_s` [s] have shape (samples,). `channels` were compared, and
    `nuisances` estimated with the faults, those `suspected` because they stood out though nobody had asked.
    Of each of the `groups` only the sum is known; `moves` is false where the actuator stood still.
    `posterior` is there where it was asked for.
    """

    components: Mapping[str, Estimate]
    coordinates: tuple[str, ...]
    covariance: Array
    method: str
    model: str
    fitness_name: str
    fitness: float
    residual_rms_A: float
    explained: bool
    evaluations: int
    reference_runs: int
    seconds: float
    seed: int
    recording: str
    actuator: Actuator
    version: str
    time_s: Array
    recorded: Array
    modelled: Array
    channels: tuple[str, ...] = ("current_A",)
    nuisances: Mapping[str, NuisanceEstimate] = field(default_factory=dict)
    groups: tuple[Group, ...] = ()
    suspected: tuple[str, ...] = ()
    moves: bool = True
    posterior: "Posterior | None" = None

    @property
    def faults(self) -> Faults:
        """The faults found."""
        return Faults(*(self.components[name].value for name in NAMES))

    @property
    def interval(self) -> dict[str, tuple[float, float]]:
        """The 95 % interval of each component."""
        return {name: estimate.interval95 for name, estimate in self.components.items()}

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm diagnose --json` prints, ready for `json.dumps`."""
        faults = {}
        for name, estimate in self.components.items():
            faults[name] = {
                "value": estimate.value,
                "standard_error": estimate.standard_error,
                "interval95": list(estimate.interval95),
                "identifiable": estimate.identifiable,
                "verdict": estimate.verdict,
            }
            if estimate.reason:
                faults[name]["reason"] = estimate.reason
        return {
            "faults": faults,
            "k": self.faults.vector.tolist(),
            "nuisances": {
                name: {
                    "value": estimate.value,
                    "standard_error": estimate.standard_error,
                    "unit": estimate.unit,
                    "known": estimate.known,
                }
                for name, estimate in self.nuisances.items()
            },
            "suspected": list(self.suspected),
            "moves": self.moves,
            "groups": [
                {"members": list(group.members), "remedies": list(group.remedies)} for group in self.groups
            ],
            "channels": list(self.channels),
            "method": self.method,
            "model": self.model,
            "fitness": self.fitness,
            "fitness_name": self.fitness_name,
            "residual_rms_A": self.residual_rms_A,
            "explained": self.explained,
            "evaluations": self.evaluations,
            "reference_runs": self.reference_runs,
            "seconds": round(self.seconds, 4),
            "seed": self.seed,
            "recording": self.recording,
            "actuator": self.actuator.name,
            "covariance": {"coordinates": list(self.coordinates), "matrix": self.covariance.tolist()},
            **({"posterior": self.posterior.to_dict()} if self.posterior else {}),
            "version": self.version,
        }

    def to_json(self, path: str | Path | None = None) -> str:
        """Return the diagnosis as JSON, and write it to `path` where one is given."""
        text = json.dumps(self.to_dict(), indent=2)
        if path is not None:
            Path(path).write_text(text + "\n", encoding="utf-8")
        return text

    def plot(self) -> "Figure":
        """Draw the recording against the model, the residual, and the faults with their intervals."""
        from emaphm.plotting.diagnosis import draw_diagnosis

        return draw_diagnosis(self)

    @property
    def relative_residual(self) -> float:
        """The residual's rms as a fraction of the recorded current's."""
        size = float(np.sqrt(np.mean(self.recorded**2)))
        return self.residual_rms_A / size if size > 0 else float("inf")

    def rows(self, truth: Faults | None = None) -> list[tuple[str, ...]]:
        """Return rows of text: component, truth if given, value, interval, verdict, meaning or reason."""
        meanings = physical_text(self.faults, self.actuator)
        table = []
        for name, estimate in self.components.items():
            low, high = estimate.interval95
            row = [
                name,
                f"{estimate.value:.4f}",
                f"{low:.4f} to {high:.4f}",
                estimate.verdict,
                meanings[name],
            ]
            if not estimate.identifiable:
                row[1] = "-"
            if (low, high) == (0.0, 1.0):
                row[2] = "-"
            if estimate.reason:
                row[-1] = estimate.reason
            if truth is not None:
                row.insert(1, f"{getattr(truth, name):.4f}")
            table.append(tuple(row))
        return table

    def table(self, truth: Faults | None = None) -> str:
        """Return the components as a table of text, beside the truth if it is known."""
        header = ["fault", "found", "95 % interval", "verdict", "meaning"]
        if truth is not None:
            header.insert(1, "true")
        return format_table(header, self.rows(truth))

    def __str__(self) -> str:
        """Return what `emaphm diagnose` prints."""
        return "\n".join([self.table(), *self.notes(), self.summary()])

    def notes(self) -> list[str]:
        """Return lines: nuisances estimated besides, groups, what cannot be told, the unit, the posterior."""
        unit = {name: estimate for name, estimate in self.nuisances.items() if name.startswith(BASELINE)}
        told = {name: e for name, e in self.nuisances.items() if e.known and name not in unit}
        grouped = {name for group in self.groups for name in group.members}
        untold = [name for name in self.nuisances if name not in told.keys() | unit.keys() | grouped]
        lines = []
        if not self.moves:
            lines.append(
                "The actuator does NOT move: its command holds still, or it is jammed, too weak or switched "
                "off. Standing still tells next to nothing of its faults."
            )
        if not self.explained:
            lines.append(
                "More is left over than noise and the model answer for: something acts that is none of these "
                "faults, or the search was lost. Look at the residual before you trust them."
            )
        if told:
            values = ", ".join(f"{name} {estimate}" for name, estimate in told.items())
            lines.append(f"Estimated besides: {values}.")
        if self.suspected:
            names = ", ".join(self.suspected)
            lines.append(
                f"Off the description beyond doubt, so estimated though nobody asked: {names}. Correct the "
                "actuator's file if it stays so; without, it would read as faults."
            )
        lines += [f"Only together: {group}" for group in self.groups]
        if untold:
            seen = ", ".join(self.channels)
            lines.append(
                f"Not to be told from {seen}: {', '.join(untold)}; the intervals allow for what may be "
                "expected of it. Record more channels, or it itself."
            )
        if unit:
            values = ", ".join(f"{name.removeprefix(BASELINE)} {e}" for name, e in unit.items())
            lines.append(f"Off the calibrated baseline (relative, if without a unit): {values}.")
        if self.posterior:
            lines += self.posterior.notes(self.interval)
        return lines

    def summary(self) -> str:
        """Return one line: how well the model explains the recording, and what it took."""
        verdict = "explains the recording" if self.explained else "does NOT explain the recording"
        return (
            f"The {self.model} model {verdict}: residual {self.residual_rms_A:.3g} A rms "
            f"({100 * self.relative_residual:.1f} % of the current). "
            f"{self.method}, {self.evaluations} simulations, {self.seconds:.2f} s, seed {self.seed}."
        )
