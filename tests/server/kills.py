"""`python -m tests.server.kills --kills 10`: kills the server under uploads, and counts what is lost.

Four uploaders send recordings; at a random moment the server is killed by SIGKILL and started again. In the
end every upload that was accepted must be over, and its recording in the history, once.
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
"""Between a start and the kill."""

PAUSE_S = 5.0
"""Of an uploader after an upload was accepted."""


def send(
    server: Server, accepted: dict[int, int], numbers: "list[int]", table: Any, stop: threading.Event
) -> None:
    """Send recordings until the server is gone; note which were accepted."""
    while not stop.is_set():
        number = numbers.pop()
        fields = {"unit": f"UP-{number}", "hours": "10", "actuator": "thesis"}
        try:
            status, answer = server.send(f"{number}.csv", as_csv(table, number), fields)
        except (OSError, ValueError):  # killed in the middle: nothing was promised
            return
        if status == 202:
            accepted[number] = answer["id"]
        stop.wait(PAUSE_S)


def main() -> int:
    """Print what was accepted and what is there."""
    parser = argparse.ArgumentParser(prog="python -m tests.server.kills", description=__doc__)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    dice = random.Random(given.seed)
    table, accepted, numbers = flight(), dict[int, int](), list(range(100_000, 0, -1))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "fleet.sqlite"
        fill(file, 3)
        for _ in range(given.kills):
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
    lost = [number for number, found in states.items() if found["state"] != "done"]
    absent = [number for number in accepted if units.get(f"UP-{number}") != 1]
    print(f"{given.kills} kills, {len(accepted)} uploads accepted")
    print(f"not done in the end: {len(lost)}; not in the history exactly once: {len(absent)}")
    for number in lost[:5]:
        print(number, states[number])
    return 1 if lost or absent or not accepted else 0


if __name__ == "__main__":
    sys.exit(main())
