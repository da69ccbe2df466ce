"""The verb `fleet simulate`: a synthetic fleet with its ground truth, diagnoses and prognoses."""

import shlex
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from emaphm.cli.interruption import resumable
from emaphm.cli.options import (
    AsJson,
    Execution,
    Seed,
    check_seed,
    whole_number,
)
from emaphm.cli.output import counter, show
from emaphm.cli.units.cautions import cautions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from emaphm.execution import OnTask
    from emaphm.fleet.synthetic import FleetFolder, FleetPlan, SyntheticUnit

app = App(name="fleet", help="Simulate a synthetic fleet with known ground truth.")


@Parameter(name="*")
@dataclass(frozen=True)
class Fleet:
    """Size, flights and population of the fleet."""

    units: Annotated[int, Parameter(converter=whole_number, help="Number of units.")] = 10
    flights: Annotated[
        int, Parameter(converter=whole_number, help="Largest number of recorded check flights per unit.")
    ] = 20
    interval: Annotated[float, Parameter(help="Flight hours between two check flights [h].")] = 80.0
    population: Annotated[
        str, Parameter(help="Population from which units are drawn: 'fleet' or 'development'.")
    ] = "fleet"
    seed: Seed = 0

    def plan(self) -> "FleetPlan":
        """Return the plan of the fleet; raises an error if it is invalid."""
        from emaphm.fleet.synthetic import FleetPlan

        return FleetPlan(self.units, self.flights, self.interval, self.seed, self.population)


@app.command
def simulate(
    *,
    out: Annotated[
        Path,
        Parameter(name=("--out", "-o"), help="Folder of the fleet: a new one, or one of the same fleet."),
    ],
    fleet: Fleet = Fleet(),
    simulate_only: Annotated[
        bool, Parameter(negative="", help="Write recordings and ground truth only, without diagnoses.")
    ] = False,
    horizon: Annotated[
        float, Parameter(help="Planning horizon of the prognoses: flight hours from now on [h].")
    ] = 1000.0,
    db: Annotated[
        str | None,
        Parameter(
            help="Database of the history: an SQLite file, or postgresql://USER@HOST:PORT/DATABASE; default "
            "a file in --out."
        ),
    ] = None,
    execution: Execution = Execution(),  # noqa: B008 - frozen
    as_json: AsJson = False,
) -> None:
    """Simulate a synthetic fleet, diagnose its recordings, and predict the RUL of each unit that still works.

    After an interruption, the same command resumes.
    """
    check_seed(fleet.seed)
    execution.check()
    from emaphm.fleet.synthetic import Chain, FleetFolder, run_chain
    from emaphm.prognosis import Question

    horizon = Question(horizon).horizon
    plan, folder = fleet.plan(), FleetFolder(out)
    hint = f"finished results are stored in {out}; the same command resumes"
    with resumable(hint), _step_counters(as_json) as on_step:
        chain = Chain(plan, folder, execution.workers, execution.scheduler, db, horizon, on_step)
        made = run_chain(chain, simulate_only=simulate_only)
    address = db or str(folder.history)
    _show(folder, made, plan.interval, address, simulate_only=simulate_only, as_json=as_json)


@contextmanager
def _step_counters(quiet: bool) -> "Iterator[Callable[[str], OnTask | None]]":
    """Yield a function that starts the progress of a step and ends the progress of the previous step."""
    with ExitStack() as stack:

        def begin(step: str) -> "OnTask | None":
            stack.pop_all().close()
            return stack.enter_context(counter(step, quiet))

        yield begin


def _show(
    folder: "FleetFolder",
    units: "list[SyntheticUnit]",
    interval: float,
    address: str,
    *,
    simulate_only: bool,
    as_json: bool,
) -> None:
    from emaphm.fleet.synthetic import prognoses
    from emaphm.history.storage.address import Address
    from emaphm.text_table import NOTHING, counted, format_table

    made = {} if simulate_only else {prognosis["unit"]: prognosis for prognosis in prognoses(folder)}
    values: dict[str, Any] = {
        "synthetic": True,
        "folder": str(folder.path),
        "recordings": sum(unit.check_flights(interval).size for unit in units),
        "failed": sum(unit.failure is not None for unit in units),
        "units": [
            {
                "unit": unit.serial_number,
                "recordings": int(unit.check_flights(interval).size),
                "failure_hours": unit.failure,
                "failed": unit.failed,
                "prognosis": made.get(unit.serial_number),
            }
            for unit in units
        ],
    }
    rows = [
        (
            unit.serial_number,
            str(unit.check_flights(interval).size),
            NOTHING if unit.failure is None else f"failed at {unit.failure:,.0f} h ({unit.failed})",
            *_life(made.get(unit.serial_number)),
        )
        for unit in units
    ]
    header = ("synthetic unit", "recordings", "true end", "RUL, h", "90 %, h", "component", "advice")
    summary = (
        f"{counted(len(units), 'synthetic unit')}, {counted(values['recordings'], 'recording')}, in "
        f"{folder.path}"
    )
    more = f"emaphm prognose --unit UNIT --db {shlex.quote(Address.of(address).shown)}"
    lines = [format_table(header, rows), *cautions(list(made.values()), more), summary]
    show(values, "\n".join(lines), as_json)


def _life(prognosis: dict[str, Any] | None) -> tuple[str, str, str, str]:
    """Return the median and interval of the RUL, the component and the advice, as text."""
    from emaphm.prognosis.advice import advice_in_words
    from emaphm.text_table import NOTHING

    if prognosis is None:
        return (NOTHING,) * 4
    rul, advice = prognosis["rul_hours"], prognosis["advice"]
    median, low, high = (
        "none in sight" if x is None else f"{x:,.0f}" for x in (rul["median"], *rul["interval90"])
    )
    return (
        median,
        f"{low} to {high}",
        prognosis["component"] or NOTHING,
        advice_in_words(advice),
    )
