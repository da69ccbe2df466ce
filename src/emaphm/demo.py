"""Demonstration: simulation and diagnosis of a faulty actuator, compared with the true faults."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.diagnosis import Diagnosis, diagnose, error_percent
from emaphm.errors import OutputError
from emaphm.output_files import check_writable, written_whole
from emaphm.plotting.diagnosis import draw_diagnosis
from emaphm.report import write_report
from emaphm.simulated_recording import simulate

FAULTS = Faults(
    friction=0.3,
    backlash=0.4,
    short_b=0.25,
    eccentricity=0.35,
    eccentricity_phase=0.7,
    gain=0.4,
)
NOISE = 0.05
"""Sensor noise, rms [A]."""

NEXT = """\
Next:
  emaphm init rig.toml                                  describe your own actuator, by a few questions
  emaphm design --actuator rig.toml --out command.csv   find the command that identifies its faults best
  emaphm calibrate healthy.csv --actuator rig.toml --laws auto -o unit.toml
  emaphm diagnose flight.csv --actuator unit.toml --report flight.html
  emaphm doctor                                         show the installed versions and available extras"""


@dataclass(frozen=True)
class Demo:
    """The diagnosis, the true faults, and the paths of the report and the figure."""

    diagnosis: Diagnosis
    truth: Faults
    report: Path
    figure: Path

    @property
    def error(self) -> float:
        """The error of the diagnosis [%]."""
        return float(error_percent(self.truth.vector, self.diagnosis.faults.vector))

    def to_dict(self) -> dict[str, Any]:
        """Return the diagnosis with the true faults and the error."""
        return {
            **self.diagnosis.to_dict(),
            "true_k": self.truth.vector.tolist(),
            "error_percent": self.error,
            "report": str(self.report),
            "figure": str(self.figure),
        }

    def __str__(self) -> str:
        """Return the estimates with the true values."""
        diagnosis = self.diagnosis
        lines = [
            f"A faulty actuator was simulated; its currents were recorded with {NOISE:g} A rms of noise.",
            "",
            diagnosis.table(self.truth),
            *diagnosis.notes(),
            diagnosis.summary(),
            f"Error: {self.error:.2f} %. Report: {self.report}, figure: {self.figure}",
            "",
            NEXT,
        ]
        return "\n".join(lines)


def run_demo(
    folder: Path, *, seed: int = 0, force: bool = False, on_progress: Callable[[float], None] | None = None
) -> Demo:
    """Simulate, diagnose, and write `report.html` and `diagnosis.svg` into `folder`, created if absent.

    Raises
    ------
    OutputError
        The folder cannot be created, or contains these files already and `force` is not set.
    """
    report, figure = folder / "report.html", folder / "diagnosis.svg"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{folder}: this folder cannot be created ({error.strerror}); give another --out"
        ) from None
    for path in (report, figure):
        check_writable(path, force=force)
    actuator = Actuator.thesis()
    recording = simulate(actuator, Chirp(), faults=FAULTS, noise=NOISE, seed=seed)
    diagnosis = diagnose(recording, actuator, seed=seed, on_progress=on_progress)
    with written_whole(figure) as temporary:
        draw_diagnosis(diagnosis, FAULTS).savefig(temporary, format="svg")
    write_report(diagnosis, report, truth=FAULTS, force=force)
    return Demo(diagnosis, FAULTS, report, figure)
