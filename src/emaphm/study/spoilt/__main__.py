"""Diagnose the spoilt recordings of a known actuator, and say what became of them.

    python -m emaphm.study.spoilt studies/spoilt

does what is missing in the folder, and prints a table; `python -m emaphm.report.spoilt_page studies/spoilt
docs` writes the page.
"""

import argparse
import sys

from emaphm.errors import EmaphmError
from emaphm.study.spoilt.judging import OUTCOME_TITLES
from emaphm.study.spoilt.rates import rows, undetected_errors
from emaphm.study.spoilt.run import cases, results, run
from emaphm.text_table import format_table


def main() -> None:
    """Run the study as the command line asks."""
    parser = argparse.ArgumentParser(prog="python -m emaphm.study.spoilt", description=__doc__)
    parser.add_argument("folder", help="where results are kept; the same command goes on")
    parser.add_argument("--workers", type=int, help="processes; one a core if left out")
    parser.add_argument("--share", type=float, default=1.0, help="share of the faults to try, up to 1")
    parser.add_argument("--only", help="a class of spoilt recordings, or a group of them")
    asked = parser.parse_args()
    chosen = cases(asked.share, asked.only)
    run(asked.folder, chosen, workers=asked.workers, on_task=_count if sys.stderr.isatty() else None)
    found = results(asked.folder, chosen)
    print(format_table(["class", "cases", *OUTCOME_TITLES], rows(found)))
    for case, one in undetected_errors(found):
        print(f"undetected error: {case.name}: {', '.join(one['wrong'])}")


def _count(done: int, total: int) -> None:
    sys.stderr.write(f"\r{done} of {total}")
    sys.stderr.flush()


if __name__ == "__main__":
    try:
        main()
    except EmaphmError as error:
        sys.exit(f"error: {error}")
