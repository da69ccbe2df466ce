"""Folder of a synthetic fleet: recordings as an operator would have them, and the truth separately."""

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
from emaphm.output_files import make_folder, written_whole

SETTINGS = "synthetic-fleet.json"

README = """\
A synthetic fleet: no unit of it exists. Made by `emaphm fleet simulate`.

synthetic-fleet.json   plan of the fleet
actuator.toml          the actuator of all units, with its requirements
flights.csv            the check flights: unit, hours, cycles, file of the recording
recordings/            a folder per unit, a file per check flight, by the reference model with noise
history.sqlite         diagnoses, removals, findings (unless another history was given)
prognoses.ndjson       a line per unit that still works: its remaining useful life
truth/                 data that an operator does not have: levels, laws, hours of failure
"""

HOURS_A_CYCLE = 2.0
"""Flight hours of one flight [h]."""

DECIDING_HERE = ("plan", "population", "growth", "unit", "recordings", "tasks")


@dataclass(frozen=True)
class CheckFlight:
    """The `number`-th check flight of a unit at flight `hours` [h], recorded in the file at `path`."""

    unit: str
    number: int
    hours: float
    path: Path

    @property
    def cycles(self) -> int:
        """Number of flights of the unit until then."""
        return round(self.hours / HOURS_A_CYCLE)


@dataclass(frozen=True)
class FleetFolder:
    """Folder of a synthetic fleet at `path`."""

    path: Path

    @property
    def work(self) -> WorkFolder:
        """The folder as a work folder, in which one process works at a time."""
        return WorkFolder(self.path, SETTINGS, "synthetic fleet", ExecutionError)

    @property
    def history(self) -> Path:
        """Path of the history, unless another one was given."""
        return self.path / "history.sqlite"

    @property
    def prognoses(self) -> Path:
        """Path of the prognoses, with a line of JSON each."""
        return self.path / "prognoses.ndjson"

    def flights(self, unit: SyntheticUnit, plan: FleetPlan) -> tuple[CheckFlight, ...]:
        """Return the check flights of a unit."""
        place = self.path / "recordings" / unit.serial_number
        return tuple(
            CheckFlight(unit.serial_number, i, float(hours), place / f"flight-{i:04d}.parquet")
            for i, hours in enumerate(unit.check_flights(plan.interval), start=1)
        )

    def begin(self, plan: FleetPlan) -> None:
        """Create the folder, or resume one that was started with the same plan and code.

        Raises
        ------
        ExecutionError
            The folder contains another fleet, a fleet of another version, or other files.
        """
        here = {"synthetic": True, "plan": plan.to_dict(), "revision": revision()}
        differing = self.work.begin_or_resume(json.dumps(here, indent=1))
        if differing:
            raise ExecutionError(
                f"{self.path} contains another synthetic fleet: {differing}; give the same plan, or "
                "another folder with -o"
            )

    def write_description(self, units: list[SyntheticUnit], plan: FleetPlan, actuator: Actuator) -> None:
        """Write the actuator, the list of check flights and the truth, without recordings and results.

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
            (flight.unit, flight.hours, flight.cycles, str(flight.path.relative_to(self.path)))
            for unit in units
            for flight in self.flights(unit, plan)
        ]
        frame = pl.DataFrame(rows, schema=["unit", "hours", "cycles", "recording"], orient="row")
        with written_whole(self.path / "flights.csv") as temporary:
            frame.write_csv(temporary)
        make_folder(self.path / "truth")
        truth = {"synthetic": True, "units": [unit.to_dict() for unit in units]}
        _write(self.path / "truth" / "units.json", json.dumps(truth, indent=1))
        with written_whole(self.path / "truth" / "levels.parquet") as temporary:
            _levels(units).write_parquet(temporary)


def revision() -> str:
    """Return a fingerprint of the code that determines recordings and diagnoses of a fleet."""
    own = tuple(f"fleet/synthetic/{name}.py" for name in DECIDING_HERE)
    return revision_of((*DECIDING, "simulated_recording.py", *own), NOT_DECIDING)


def _levels(units: list[SyntheticUnit]) -> Any:
    """Return a frame of the true levels, with a row per time of a unit."""
    import polars as pl

    from emaphm.actuator.faults import NAMES

    return pl.concat(
        pl.DataFrame(
            {
                "unit": [unit.serial_number] * unit.hours.size,
                "hours": unit.hours,
                "ageing_hours": unit.ageing,
                **dict(zip(NAMES, unit.vectors.T, strict=True)),
            }
        )
        for unit in units
    )


def _write(path: Path, text: str) -> None:
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
