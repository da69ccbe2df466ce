"""`python -m tests.server.kills --kills 10`: kills the server during uploads, and counts lost recordings.

Four uploaders send recordings; at a random time the server is killed by SIGKILL and started again. At the
end, every accepted upload must be done, and the history must contain its recording exactly once.
"""

import argparse
import random
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from emaphm.history import History

from .flights import as_csv, flight
from .made_up import fill
from .process import Server, over, start

UPLOADERS = 4

LONGEST_S = 6.0
"""Longest time between a start and the kill."""

PAUSE_S = 5.0
"""Pause of an uploader after an accepted upload."""


def send(
    server: Server, accepted: dict[int, int], numbers: "list[int]", table: Any, stop: threading.Event
) -> None:
    """Send recordings until the server is killed; note the accepted uploads."""
    while not stop.is_set():
        number = numbers.pop()
        fields = {"unit": f"UP-{number}", "hours": "10", "actuator": "thesis"}
        try:
            status, answer = server.send(f"{number}.csv", as_csv(table, number), fields)
        except (OSError, ValueError):  # killed during the request, so nothing was accepted
            return
        if status == 202:
            accepted[number] = answer["id"]
        stop.wait(PAUSE_S)


def main() -> int:
    """Print the numbers of accepted uploads and of lost recordings."""
    parser = argparse.ArgumentParser(prog="python -m tests.server.kills", description=__doc__)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    dice = random.Random(arguments.seed)
    table, accepted, numbers = flight(), dict[int, int](), list(range(100_000, 0, -1))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "fleet.sqlite"
        fill(file, 3)
        for _ in range(arguments.kills):
            server, stop = start(file), threading.Event()
            threads = [
                threading.Thread(target=send, args=(server, accepted, numbers, table, stop))
                for _ in range(UPLOADERS)
            ]
            for thread in threads:
                thread.start()
            time.sleep(dice.random() * LONGEST_S)
            server.kill()
            stop.set()
            for thread in threads:
                thread.join()
        server = start(file)
        states = {number: over(server, job) for number, job in accepted.items()}
        server.process.terminate()
        server.process.wait(30)
        with History.open(file) as history:
            units = {unit.serial_number: len(unit.diagnoses()) for unit in history.units()}
    not_done = [number for number, job in states.items() if job["state"] != "done"]
    absent = [number for number in accepted if units.get(f"UP-{number}") != 1]
    print(f"{arguments.kills} kills, {len(accepted)} uploads accepted")
    print(f"not done in the end: {len(not_done)}; not in the history exactly once: {len(absent)}")
    for number in not_done[:5]:
        print(number, states[number])
    return 1 if not_done or absent or not accepted else 0


if __name__ == "__main__":
    sys.exit(main())
