"""The folder of a synthetic fleet: the recordings of an operator, and separately the true levels."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from emaphm.actuator import Actuator
from emaphm.diagnosis.deciding_code import NOT_DECIDING
from emaphm.errors import ExecutionError
from emaphm.execution.folder import WorkFolder
from emaphm.execution.revision import revision_of
from emaphm.fleet.synthetic.plan import FleetPlan
from emaphm.fleet.synthetic.unit import SyntheticUnit
from emaphm.fleet.task import DECIDING
from emaphm.output_files import make_folder, write_table, written_whole
from emaphm.prognosis.stress import Stress

SETTINGS = "synthetic-fleet.json"

README = """\
A synthetic fleet: no unit of it exists. Made by `emaphm fleet simulate`.

synthetic-fleet.json   the plan of the fleet
actuator.toml          the actuator that the units are of, with its requirements
flights.csv            the check flights: unit, hours, cycles, mean load and temperature since the previous
                       one, file of the recording
recordings/            a folder for each unit, a file for each check flight: reference model with noise
history.sqlite         diagnoses, removals, findings (unless another history was named)
prognoses.ndjson       a line for each unit that still works: its remaining useful life
truth/                 true levels, laws and hours of failure, which an operator does not have
"""

HOURS_A_CYCLE = 2.0
"""Flight hours of one flight [h]."""

DECIDING_HERE = ("plan", "population", "growth", "unit", "recordings", "tasks")


@dataclass(frozen=True)
class CheckFlight:
    """A check flight of a unit, its `number`-th, at flight `hours` [h], recorded in the file at `path`.

    `stress` is the mean stress since the previous check flight.
    """

    unit: str
    number: int
    hours: float
    path: Path
    stress: Stress

    @property
    def cycles(self) -> int:
        """Number of flights of the unit up to this check flight."""
        return round(self.hours / HOURS_A_CYCLE)


@dataclass(frozen=True)
class FleetFolder:
    """The folder of a synthetic fleet at `path`."""

    path: Path

    @property
    def work(self) -> WorkFolder:
        """The folder with a lock, so that one process at a time works in it."""
        return WorkFolder(self.path, SETTINGS, "synthetic fleet", ExecutionError)

    @property
    def history(self) -> Path:
        """The file of the history, unless another history was named."""
        return self.path / "history.sqlite"

    @property
    def prognoses(self) -> Path:
        """The file of the prognoses, a line of JSON for each."""
        return self.path / "prognoses.ndjson"

    def flights(self, unit: SyntheticUnit, plan: FleetPlan) -> tuple[CheckFlight, ...]:
        """Return the check flights of a unit."""
        place, model = self.path / "recordings" / unit.serial_number, plan.drawn_from.stress
        return tuple(
            CheckFlight(
                unit.serial_number,
                i,
                float(hours),
                place / f"flight-{i:04d}.parquet",
                unit.recorded_stress(i, model),
            )
            for i, hours in enumerate(unit.check_flights(plan.interval), start=1)
        )

    def begin(self, plan: FleetPlan) -> None:
        """Make the folder, or continue in a folder of the same plan and code.

        Raises
        ------
        ExecutionError
            The folder holds a fleet of another plan or version, or other files.
        """
        here = {"synthetic": True, "plan": plan.to_dict(), "revision": revision()}
        differing = self.work.begin_or_resume(json.dumps(here, indent=1))
        if differing:
            raise ExecutionError(
                f"{self.path} holds another synthetic fleet: {differing}; ask for the same one, or give "
                "another folder with -o"
            )

    def write_description(self, units: list[SyntheticUnit], plan: FleetPlan, actuator: Actuator) -> None:
        """Write the actuator, the list of check flights, and the true levels.

        Raises
        ------
        OutputError
            A file cannot be written.
        """
        import polars as pl

        from emaphm.actuator.toml import write_toml

        _write(self.path / "README.txt", README)
        _write(self.path / "actuator.toml", f"# The actuator of a synthetic fleet.\n\n{write_toml(actuator)}")
        rows = [
            (
                one.unit,
                one.hours,
                one.cycles,
                one.stress.load,
                one.stress.temperature,
                str(one.path.relative_to(self.path)),
            )
            for unit in units
            for one in self.flights(unit, plan)
        ]
        columns = ["unit", "hours", "cycles", "load_Nm", "temperature_K", "recording"]
        write_table(pl.DataFrame(rows, schema=columns, orient="row"), self.path / "flights.csv")
        make_folder(self.path / "truth")
        truth = {"synthetic": True, "units": [unit.to_dict() for unit in units]}
        _write(self.path / "truth" / "units.json", json.dumps(truth, indent=1))
        write_table(_levels(units), self.path / "truth" / "levels.parquet")


def revision() -> str:
    """Return a fingerprint of the code that decides the recordings and diagnoses of a fleet."""
    own = tuple(f"fleet/synthetic/{name}.py" for name in DECIDING_HERE)
    return revision_of((*DECIDING, "simulated_recording.py", *own), NOT_DECIDING)


def _levels(units: list[SyntheticUnit]) -> Any:
    """Return a frame of the true levels, with a row for each unit and time."""
    import polars as pl

    from emaphm.actuator.faults import NAMES

    return pl.concat(
        pl.DataFrame(
            {
                "unit": [one.serial_number] * one.hours.size,
                "hours": one.hours,
                "ageing_hours": one.ageing,
                **dict(zip(NAMES, one.vectors.T, strict=True)),
            }
        )
        for one in units
    )


def _write(path: Path, text: str) -> None:
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
