"""The files that the examples of the pages use: recordings of a simulated unit, its description, its history.

Everything is simulated by the reference model: an actuator whose friction and backlash grow over its flights.
`python docs/site/examples.py FOLDER` makes them, to try the examples by hand.
"""

import sys
from pathlib import Path

import emaphm as ema
from emaphm.history import Entry

NOISE, BITS = 0.05, 12
HEALTHY_RUNS = 12
FLIGHTS = 10
"""In the history: one diagnosis every hundred hours."""


def write_examples(folder: Path) -> None:
    """Write all of them into `folder`, which must not exist."""
    folder.mkdir(parents=True)
    actuator = ema.Actuator.thesis()
    for name in ("rig", "unit", "unit-7"):
        actuator.to_toml(folder / f"{name}.toml")
    days = {"monday": 0.02, "tuesday": 0.05, "wednesday": 0.08, "friday": 0.12, "flight": 0.3, "today": 0.35}
    for seed, (name, friction) in enumerate(days.items()):
        _write(folder / f"{name}.csv", actuator, ema.Faults(friction=friction, backlash=friction / 2), seed)
    for name, files in (("flights", 3), ("healthy", HEALTHY_RUNS)):
        (folder / name).mkdir()
        for number in range(files):
            faults = ema.Faults(friction=0.1 * number) if name == "flights" else ema.Faults()
            _write(folder / name / f"{number + 1:02d}.csv", actuator, faults, 100 + number)
    (folder / "incoming").mkdir()
    for hours in (100, 120):
        faults = ema.Faults(friction=hours / 1000)
        _write(folder / "incoming" / f"SN-0007_{hours}.csv", actuator, faults, hours)
    _write_history(folder / "history.sqlite", actuator)


def _write(path: Path, actuator: ema.Actuator, faults: ema.Faults, seed: int) -> None:
    ema.write_recording(_recorded(actuator, faults, seed), path)


def _recorded(actuator: ema.Actuator, faults: ema.Faults, seed: int) -> ema.Recording:
    return ema.simulate(actuator, ema.Chirp(), faults=faults, noise=NOISE, adc_bits=BITS, seed=seed)


def _write_history(path: Path, actuator: ema.Actuator) -> None:
    with ema.History.open(str(path), create=True) as history:
        for flight in range(FLIGHTS):
            hours = 100.0 * (flight + 1)
            level = 0.02 + 0.03 * flight
            recording = _recorded(actuator, ema.Faults(friction=level, backlash=level / 3), 200 + flight)
            diagnosis = ema.diagnose(recording, actuator)
            history.add(Entry("SN-0042", actuator.name, hours), recording, diagnosis)


if __name__ == "__main__":
    write_examples(Path(sys.argv[1]))
