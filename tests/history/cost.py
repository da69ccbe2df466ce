"""`python -m tests.history.cost --units 1000 --each 100 [--db URL]`: time and space of a history.

The diagnoses are synthetic, so only the database and its rows are timed. Each unit is added in one
transaction, as by a bulk loader; a few more recordings are added singly, as by `emaphm history add`.
Prognoses are timed for the units of the first part number, or of all part numbers with `--prognosed all`.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from emaphm.history import History, KeptSettings
from emaphm.history.fingerprint import description_of
from emaphm.history.writing import add_diagnosis
from emaphm.prognosis import Evidence, learnt_prior, prognose
from emaphm.prognosis.batch import prognose_all
from emaphm.prognosis.filter.following import follow
from emaphm.prognosis.prior import Prior
from emaphm.recording.content import recording_hash

from .made_up import PART, THESIS, diagnosis, entry, recording

DIFFERENT = 20
"""Number of different synthetic diagnoses; all further diagnoses repeat them."""

ONE_BY_ONE = 50

OF_A_PART = 40
"""Units of a part number."""


def part_of(unit: int) -> str:
    """Return the part number of a unit."""
    return f"{PART} {unit // OF_A_PART}"


def fill(history: History, units: int, per_unit: int) -> None:
    """Add `each` recordings of every unit."""
    diagnoses = [diagnosis(number) for number in range(DIFFERENT)]
    digest, toml = description_of(THESIS)
    settings = KeptSettings.of(diagnoses[0], digest)
    for unit in range(units):
        with history.database.writing() as connection:
            for number in range(per_unit):
                held = recording(unit * per_unit + number)
                whose = entry(f"S{unit:05d}", 10.0 * number, part=part_of(unit))
                result = diagnoses[number % DIFFERENT]
                add_diagnosis(connection, whose, held, result, recording_hash(held), settings, toml)


def add_one_by_one(history: History) -> None:
    for number in range(ONE_BY_ONE):
        history.add(entry("LAST", 10.0 * number), recording(10**9 + number), diagnosis(number))


def time_prognoses(where: str, part: str | None, workers: int) -> None:
    """Print the times of prognoses: filter update, one unit, all units of a part number or of the history."""
    with History.open(where) as history:
        unit = history.unit("S00000")
        evidence, actuator = Evidence.of(unit), unit.actuator
        took = cpu_seconds(lambda: follow(evidence, Prior()))
        count = len(evidence.used)
        print(f"follow a unit's {count}: {took:.2f} s, {1e3 * took / count:.1f} ms of processor an update")
        print(f"prognose one, alone: {cpu_seconds(lambda: prognose(evidence, actuator)):.2f} s of processor")
        took = cpu_seconds(lambda: learnt_prior(history, unit))
        again = cpu_seconds(lambda: learnt_prior(history, unit))
        count = learnt_prior(history, unit).units
        print(f"the prior from {count} other units: {took:.1f} s of processor, {again:.2f} s the second time")
    began, spent = time.perf_counter(), sum(os.times()[:4])
    results = list(prognose_all(where, part_number=part, workers=workers))
    took, spent = time.perf_counter() - began, sum(os.times()[:4]) - spent
    failed = sum(bool(result.error) for result in results)
    print(
        f"prognose {len(results)} units on {workers} workers: {took:.0f} s, processor {spent:.0f} s, "
        f"{spent / len(results):.2f} s each; {failed} failed"
    )


def cpu_seconds(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main() -> int:
    """Print a line for each kind of use."""
    parser = argparse.ArgumentParser(prog="python -m tests.history.cost", description=__doc__)
    parser.add_argument("--units", type=int, default=1000)
    parser.add_argument("--each", type=int, default=100)
    parser.add_argument(
        "--prognosed", choices=("none", "part", "all"), default="part", help="whose prognoses are timed"
    )
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--db", help="an empty PostgreSQL database; a file if left out")
    arguments = parser.parse_args()
    total = arguments.units * arguments.each
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "history.sqlite"
        with History.open(arguments.db or file, create=True) as history:
            took = seconds(lambda: fill(history, arguments.units, arguments.each))
            print(f"add {total} of {arguments.units} units: {took:.1f} s, {1e3 * took / total:.2f} ms each")
            took = seconds(lambda: add_one_by_one(history))
            print(f"add one, on disk when it returns: {1e3 * took / ONE_BY_ONE:.1f} ms")
            print(f"list: {seconds(history.states):.2f} s")
            took = seconds(lambda: history.unit("S00000").diagnoses())
            print(f"read a unit's {arguments.each}: {1e3 * took:.1f} ms")
            took = seconds(lambda: [unit.diagnoses() for unit in history.units()])
            print(f"read all: {took:.1f} s")
        if arguments.prognosed != "none":
            part = part_of(0) if arguments.prognosed == "part" else None
            time_prognoses(arguments.db or str(file), part, arguments.workers)
        if not arguments.db:
            print(f"on disk: {file.stat().st_size / total:.0f} bytes a diagnosis")
    return 0


if __name__ == "__main__":
    sys.exit(main())
