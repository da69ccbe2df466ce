"""Diagnose the spoilt recordings of a known actuator, and print the outcomes.

    python -m emaphm.study.spoilt studies/spoilt

runs the cases whose results are missing in the folder, and prints a table; `python -m
emaphm.report.spoilt_page studies/spoilt docs` writes the page.
"""

import argparse
import sys

from emaphm.errors import EmaphmError
from emaphm.study.spoilt.judging import OUTCOME_TITLES
from emaphm.study.spoilt.rates import rows, undetected_errors
from emaphm.study.spoilt.run import cases, results, run
from emaphm.text_table import format_table


def main() -> None:
    """Run the study with the arguments of the command line."""
    parser = argparse.ArgumentParser(prog="python -m emaphm.study.spoilt", description=__doc__)
    parser.add_argument("folder", help="folder for the results; the same command resumes")
    parser.add_argument("--workers", type=int, help="number of processes; default one per core")
    parser.add_argument("--share", type=float, default=1.0, help="share of the faults to use, up to 1")
    parser.add_argument("--only", help="a class of spoilt recordings, or a group of classes; default all")
    arguments = parser.parse_args()
    chosen = cases(arguments.share, arguments.only)
    run(arguments.folder, chosen, workers=arguments.workers, on_task=_count if sys.stderr.isatty() else None)
    finished = results(arguments.folder, chosen)
    print(format_table(["class", "cases", *OUTCOME_TITLES], rows(finished)))
    for case, result in undetected_errors(finished):
        print(f"undetected error: {case.name}: {', '.join(result['wrong'])}")


def _count(done: int, total: int) -> None:
    sys.stderr.write(f"\r{done} of {total}")
    sys.stderr.flush()


if __name__ == "__main__":
    try:
        main()
    except EmaphmError as error:
        sys.exit(f"error: {error}")
