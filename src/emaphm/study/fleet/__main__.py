"""Evaluate predictions of remaining useful life on a synthetic fleet.

    python -m emaphm.study.fleet studies/fleet

simulates the fleet, diagnoses it and evaluates the predictions, as far as results are missing, and prints
tables; `python -m emaphm.report.fleet.page studies/fleet docs` writes the page.
"""

import argparse
import sys
from pathlib import Path

from emaphm.errors import EmaphmError
from emaphm.execution import OnTask
from emaphm.study.fleet.acting import (
    ACTING_HEADER,
    OVER_LIFE_HEADER,
    Units,
    acted_rows,
    over_life_rows,
    tracked_ways,
)
from emaphm.study.fleet.judging import SHARES
from emaphm.study.fleet.run import PARTS, PLAN, StudyFolder, results, run
from emaphm.study.fleet.scores import HEADER, scores, ways
from emaphm.study.fleet.tracks import RULES
from emaphm.text_table import format_table


def main() -> None:
    """Run the study with the arguments of the command line."""
    parser = argparse.ArgumentParser(prog="python -m emaphm.study.fleet", description=__doc__)
    parser.add_argument("folder", type=Path, help="folder for the results; the same command resumes")
    parser.add_argument("--workers", type=int, help="number of processes; default one per core")
    parser.add_argument(
        "--units", type=int, default=PLAN.units, help=f"number of units, the first of {PLAN.units}"
    )
    arguments = parser.parse_args()
    if not 2 * PARTS <= arguments.units <= PLAN.units:
        parser.error(f"--units {arguments.units}: give {2 * PARTS} to {PLAN.units}")
    folder = StudyFolder(arguments.folder, arguments.units)
    run(folder, workers=arguments.workers, on_step=_step if sys.stderr.isatty() else lambda _: None)
    for level, units in results(folder).items():
        for share in SHARES:
            print(f"{level}, {len(units)} synthetic units, λ = {share:g}")
            print(format_table(HEADER, [(way, *scores(units, way, share).row) for way in ways(units)]))
        _print_tracks(level, units)


def _print_tracks(level: str, units: Units) -> None:
    """Print the scores over whole lives and the outcomes of removals, if predictions were tracked."""
    if not tracked_ways(units):
        return
    print(f"{level}, {len(units)} synthetic units, over their lives")
    print(format_table(OVER_LIFE_HEADER, over_life_rows(units)))
    for rule in RULES:
        print(f"{level}, {len(units)} synthetic units, removed by {rule}")
        print(format_table(ACTING_HEADER, acted_rows(units, rule)))


def _step(name: str) -> OnTask:
    def count(done: int, total: int) -> None:
        sys.stderr.write(f"\r{name}: {done} of {total} ")
        sys.stderr.flush()

    return count


if __name__ == "__main__":
    try:
        main()
    except EmaphmError as error:
        sys.exit(f"error: {error}")
