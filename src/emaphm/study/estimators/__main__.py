"""Accuracy of an estimator alone and as the start of a search, compared with the full search.

    python -m emaphm.study.estimators unit.estimator --share 0.1

prints tables in Markdown, for the base setting of docs/accuracy.md with the default chirp: errors, coverage,
false alarms and detected faults; foreign plants and spoilt recordings; the time of each diagnosis; and the
number of recordings that a core answers per second. An estimator of the current alone is also evaluated on
the thesis's multiple faults. All diagnoses estimate the nuisances of the estimator's training.
docs/fast_estimator.md quotes these tables.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

from emaphm.amortized import Estimator
from emaphm.errors import EmaphmError
from emaphm.execution import Task, outcomes
from emaphm.study.estimators.cases import GROUPS, of_base_setting, of_multiple, of_unlike
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
    """Run the study with the arguments of the command line."""
    parser = argparse.ArgumentParser(prog="python -m emaphm.study.estimators", description=__doc__)
    parser.add_argument("estimator", type=Path, help="file of 'emaphm train'")
    parser.add_argument("--workers", type=int, help="number of processes; default one per core")
    parser.add_argument("--share", type=float, default=1.0, help="share of the recordings to use, up to 1")
    parser.add_argument("--methods", nargs="+", default=METHODS, choices=(*METHODS, WITHOUT_SEARCH))
    parser.add_argument("--groups", nargs="+", default=(), choices=GROUPS, help="default all groups")
    arguments = parser.parse_args()
    if not 0 < arguments.share <= 1:
        parser.error(f"--share {arguments.share:g}: give more than 0, up to 1")
    channels = Estimator.load(arguments.estimator).setup.channels
    cases = [
        *of_base_setting(channels, arguments.share),
        *of_multiple(channels),
        *of_unlike(channels, arguments.share),
    ]
    chosen = [
        (c, m)
        for c in cases
        if not arguments.groups or c.group in arguments.groups
        for m in arguments.methods
    ]
    tasks = [
        Task(i, perform, (c, m, str(arguments.estimator)), name=c.label) for i, (c, m) in enumerate(chosen)
    ]
    results: dict[int, dict[str, Any]] = {}
    for outcome in outcomes(tasks, workers=arguments.workers):
        results[outcome.index] = refused(outcome.failure) if outcome.failure else outcome.result
        if sys.stderr.isatty():
            sys.stderr.write(f"\r{len(results)} of {len(tasks)}")
    results_by_case = [(c, m, results[i]) for i, (c, m) in enumerate(chosen)]
    for table in (accuracy_table, coverage_table, alarms_table, unlike_table):
        print(table(results_by_case), end="\n\n")
    print(speed_table(arguments.estimator))


if __name__ == "__main__":
    try:
        main()
    except EmaphmError as error:
        sys.exit(f"error: {error}")
