"""How good an estimator is: alone, as the start of a search, and next to the full search.

    python -m emaphm.study.estimators unit.estimator --share 0.1

prints tables in Markdown, on the base setting of docs/accuracy.md with the manoeuvre of the default chirp:
errors, coverage, false alarms and detected faults; foreign plants and spoilt recordings; the time of each
diagnosis; and how many recordings a core answers in a second. An estimator of the current alone is also asked
about the thesis's multiple faults. All diagnoses estimate the nuisances that the estimator was trained on.
docs/fast_estimator.md quotes them.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

from emaphm.amortized import Estimator
from emaphm.errors import EmaphmError
from emaphm.execution import Task, outcomes
from emaphm.study.estimators.cases import of_base_setting, of_multiple, of_unlike
from emaphm.study.estimators.tables import (
    accuracy_table,
    alarms_table,
    coverage_table,
    speed_table,
    unlike_table,
)
from emaphm.study.estimators.trial import METHODS, WITHOUT_SEARCH, perform
from emaphm.study.spoilt.judging import refused


def main() -> None:
    """Run the study as the command line asks."""
    parser = argparse.ArgumentParser(prog="python -m emaphm.study.estimators", description=__doc__)
    parser.add_argument("estimator", type=Path, help="file of 'emaphm train'")
    parser.add_argument("--workers", type=int, help="processes; one a core if left out")
    parser.add_argument("--share", type=float, default=1.0, help="share of the recordings to try, up to 1")
    parser.add_argument("--methods", nargs="+", default=METHODS, choices=(*METHODS, WITHOUT_SEARCH))
    parser.add_argument("--groups", nargs="+", default=(), help="some of the groups of recordings")
    asked = parser.parse_args()
    channels = Estimator.load(asked.estimator).setup.channels
    cases = [
        *of_base_setting(channels, asked.share),
        *of_multiple(channels),
        *of_unlike(channels, asked.share),
    ]
    chosen = [(c, m) for c in cases if not asked.groups or c.group in asked.groups for m in asked.methods]
    tasks = [Task(i, perform, (c, m, str(asked.estimator)), name=c.label) for i, (c, m) in enumerate(chosen)]
    results: dict[int, dict[str, Any]] = {}
    for outcome in outcomes(tasks, workers=asked.workers):
        results[outcome.index] = refused(outcome.failure) if outcome.failure else outcome.result
        if sys.stderr.isatty():
            sys.stderr.write(f"\r{len(results)} of {len(tasks)}")
    found = [(c, m, results[i]) for i, (c, m) in enumerate(chosen)]
    for table in (accuracy_table, coverage_table, alarms_table, unlike_table):
        print(table(found), end="\n\n")
    print(speed_table(asked.estimator))


if __name__ == "__main__":
    try:
        main()
    except EmaphmError as error:
        sys.exit(f"error: {error}")
