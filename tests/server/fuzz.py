"""`python -m tests.server.fuzz --requests 5000`: random requests, valid and invalid according to the schema.

Schemathesis draws the requests from /openapi.json. No answer may have a status of 500 or above, except 503
while uploads wait. The uploaded content is random.
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


def send_requests(
    operation: Any, mode: Any, count: int, number: int, note: Callable[[str, int, str], None]
) -> None:
    """Send `count` requests of an operation, drawn from its schema."""
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

    with contextlib.suppress(Unsatisfiable):  # an operation without parameters has no invalid requests
        ask()


def main() -> int:
    """Print the number of requests of each operation by the status of the answer."""
    parser = argparse.ArgumentParser(prog="python -m tests.server.fuzz", description=__doc__)
    parser.add_argument("--requests", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    logging.disable(logging.INFO)
    import schemathesis
    from schemathesis.generation import GenerationMode

    answers: Counter[tuple[str, int]] = Counter()
    defects: list[str] = []

    def note(label: str, status: int, request: str) -> None:
        answers[label, status] += 1
        if status >= SERVER_ERROR and status != BUSY:
            defects.append(f"{request} {status}")

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "fleet.sqlite"
        fill(file, 20)
        with serving(file) as server:
            schema = schemathesis.openapi.from_url(f"http://{server.address}/openapi.json")
            operations: list[Any] = [result.ok() for result in schema.get_all_operations()]  # type: ignore[union-attr]
            modes = (GenerationMode.POSITIVE, GenerationMode.NEGATIVE)
            per_mode = -(-arguments.requests // (len(operations) * len(modes)))
            rounds = 0
            # Some operations have few different requests, so more of the other operations are sent.
            while sum(answers.values()) < arguments.requests:
                for operation in operations:
                    for mode in modes:
                        send_requests(operation, mode, per_mode, arguments.seed + rounds, note)
                rounds += 1
            alive = server.get("/")[0] == 200
    for name in sorted({name for name, _ in answers}):
        statuses = {status: count for (label, status), count in sorted(answers.items()) if label == name}
        print(f"{name:40} {statuses}")
    print(f"{sum(answers.values())} requests, {len(defects)} answered by a defect, server alive: {alive}")
    for request in defects[:10]:
        print(request)
    return 1 if defects or not alive else 0


if __name__ == "__main__":
    sys.exit(main())
