"""`python -m tests.fuzz --minutes 10`: spoilt inputs for a given time.

Each complaint is written to its own folder: the files, the command line and the complaint.
"""

import argparse
import sys
from pathlib import Path

from .classes import CLASSES
from .run import Report, fuzz


def _keep(report: Report, folder: Path) -> None:
    for number, (name, case, complaint) in enumerate(report.complaints):
        place = folder / f"{number:03d}-{name.replace(': ', '-').replace(' ', '-')}"
        place.mkdir(parents=True, exist_ok=True)
        for file, content in case.files.items():
            (place / file).parent.mkdir(exist_ok=True)
            (place / file).write_bytes(content)
        (place / "complaint.txt").write_text(f"{case.arguments!r}\n{complaint}\n", "utf-8", "replace")


def main() -> int:
    """Run the fuzzer; return 1 if there is any complaint."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, help="how long; 10 if neither is given")
    parser.add_argument("--cases", type=int, help="how many")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--classes", nargs="*", default=(), choices=list(CLASSES), help="all if left out")
    parser.add_argument("--out", type=Path, default=Path("fuzz"), help="folder for what is found")
    options = parser.parse_args()
    minutes = 10.0 if options.minutes is None and options.cases is None else options.minutes
    report = fuzz(
        options.seed,
        cases=options.cases,
        seconds=None if minutes is None else 60 * minutes,
        names=options.classes,
    )
    print(report)
    if report.complaints:
        _keep(report, options.out)
        print(f"what is wrong: {options.out}")
    return int(bool(report.complaints))


if __name__ == "__main__":
    sys.exit(main())
