"""`python -m tests.server.fuzz --requests 5000`: requests that the schema allows, and some that it does not.

Schemathesis draws them from /openapi.json; none may be answered by 500 or more, but for 503 where uploads
wait. What is uploaded is rubbish.
"""

import argparse
import contextlib
import logging
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .made_up import fill
from .process import serving

SERVER_ERROR, BUSY = 500, 503


def asked(operation: Any, mode: Any, count: int, number: int, note: Callable[[str, int, str], None]) -> None:
    """Send `count` requests of an operation, as they are drawn from its schema."""
    from hypothesis import HealthCheck, Phase, given, seed, settings
    from hypothesis.errors import Unsatisfiable

    @seed(number)
    @settings(
        max_examples=count,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(operation.as_strategy(generation_mode=mode))
    def ask(case: Any) -> None:
        answer = case.call()
        note(operation.label, answer.status_code, f"{case.method} {case.path} {answer.text[:200]}")

    with contextlib.suppress(Unsatisfiable):  # an operation without parameters cannot be asked wrongly
        ask()


def main() -> int:
    """Print how many requests each operation was sent, and what they were answered with."""
    parser = argparse.ArgumentParser(prog="python -m tests.server.fuzz", description=__doc__)
    parser.add_argument("--requests", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    logging.disable(logging.INFO)
    import schemathesis
    from schemathesis.generation import GenerationMode

    answers: Counter[tuple[str, int]] = Counter()
    bad: list[str] = []

    def note(label: str, status: int, request: str) -> None:
        answers[label, status] += 1
        if status >= SERVER_ERROR and status != BUSY:
            bad.append(f"{request} {status}")

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "fleet.sqlite"
        fill(file, 20)
        with serving(file) as server:
            schema = schemathesis.openapi.from_url(f"http://{server.address}/openapi.json")
            operations: list[Any] = [found.ok() for found in schema.get_all_operations()]  # type: ignore[union-attr]
            modes = (GenerationMode.POSITIVE, GenerationMode.NEGATIVE)
            each = -(-given.requests // (len(operations) * len(modes)))
            rounds = 0
            # Some operations have few requests that differ: the others are sent more.
            while sum(answers.values()) < given.requests:
                for operation in operations:
                    for mode in modes:
                        asked(operation, mode, each, given.seed + rounds, note)
                rounds += 1
            alive = server.get("/")[0] == 200
    for name in sorted({name for name, _ in answers}):
        statuses = {status: count for (one, status), count in sorted(answers.items()) if one == name}
        print(f"{name:40} {statuses}")
    print(f"{sum(answers.values())} requests, {len(bad)} answered by a defect, server alive: {alive}")
    for one in bad[:10]:
        print(one)
    return 1 if bad or not alive else 0


if __name__ == "__main__":
    sys.exit(main())
