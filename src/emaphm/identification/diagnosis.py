"""What a diagnosis is: the faults found, how sure each is, and how it was computed."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.actuator.quantity import unit_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """One fault component: its normalised value, standard error and 95 % interval.

    `identifiable` is false where the data do not constrain it, and `reason` says why. The interval of
    the eccentricity's phase may run past 0 or 1, where the circle closes.
    """

    value: float
    standard_error: float
    interval95: tuple[float, float]
    identifiable: bool
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The faults that explain a recording.

    `components` has the eight of `Faults` in order; `covariance` (d, d) is in estimator coordinates, whose
    names are `coordinates`. `fitness` is the method's own measure, `residual_rms_A` the rms of recorded
    less modelled current; `explained` is false where that is more than the model can answer for.
    `recorded`, `modelled` [A] and `time_s` [s] have shape (samples,).
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
            }
            if estimate.reason:
                faults[name]["reason"] = estimate.reason
        return {
            "faults": faults,
            "k": self.faults.vector.tolist(),
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
        from emaphm.identification.figures import draw_diagnosis

        return draw_diagnosis(self)

    def rows(self, truth: Faults | None = None) -> list[tuple[str, ...]]:
        """Return a table of text: component, value, interval, physical meaning, and the truth if given."""
        meanings = physical_text(self.faults, self.actuator)
        table = []
        for name, estimate in self.components.items():
            low, high = estimate.interval95
            row = [name, f"{estimate.value:.4f}", f"{low:.4f} to {high:.4f}", meanings[name]]
            if not estimate.identifiable:
                row = [name, "-", "-", estimate.reason]
            if truth is not None:
                row.insert(1, f"{getattr(truth, name):.4f}")
            table.append(tuple(row))
        return table

    def __str__(self) -> str:
        """Return the table that `emaphm diagnose` prints."""
        return (
            format_table(("fault", "found", "95 % interval", "meaning"), self.rows()) + "\n" + self.summary()
        )

    def summary(self) -> str:
        """Return one line: how well the model explains the recording, and what it took."""
        share = 100 * self.residual_rms_A / max(float(np.sqrt(np.mean(self.recorded**2))), 1e-300)
        verdict = "explains the recording" if self.explained else "does NOT explain the recording"
        return (
            f"The {self.model} model {verdict}: residual {self.residual_rms_A:.3g} A rms ({share:.1f} % of the "
            f"current). {self.method}, {self.evaluations} simulations, {self.seconds:.2f} s, seed {self.seed}."
        )


def physical_text(faults: Faults, actuator: Actuator) -> dict[str, str]:
    """Return what each component means on `actuator`, with its unit."""
    p = faults.physical(actuator)
    angle = unit_for("rad", actuator.coordinates)
    return {
        "friction": f"dry friction × {p['friction_factor']:.3f}",
        "backlash": f"backlash {p['backlash_rad']:.4g} {angle} at the motor",
        "short_a": f"{100 * p['turns_a']:.1f} % of phase a's turns healthy",
        "short_b": f"{100 * p['turns_b']:.1f} % of phase b's turns healthy",
        "short_c": f"{100 * p['turns_c']:.1f} % of phase c's turns healthy",
        "eccentricity": f"rotor off centre by {100 * p['eccentricity_Z']:.1f} % of the air gap",
        "eccentricity_phase": f"towards {np.degrees(p['eccentricity_phase_rad']):+.1f} deg",
        "gain": f"position gain × {p['gain_factor']:.4f}",
    }


def format_table(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """Return rows of text as an aligned table."""
    widths = [max(len(row[i]) for row in [header, *rows]) for i in range(len(header))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in [header, *rows]
    ]
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])
