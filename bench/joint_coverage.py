"""Joint diagnoses of n recordings of one unit: coverage and width of their intervals.

Random faults on the base setting of docs/accuracy.md; load, temperature and noise differ between
recordings. `python -m bench.joint_coverage --cases 24 --sizes 1,4,8` takes some minutes.
"""

import argparse
from collections.abc import Sequence

import numpy as np

import emaphm as ema
from emaphm.actuator import NAMES
from emaphm.arrays import Array, Flags
from emaphm.study import cases
from emaphm.study.analysis.rates import holds
from emaphm.study.record import recorded
from emaphm.study.rig import Manoeuvre, Rig
from emaphm.text_table import format_table

SEEDS = 1000
"""Number of seeds of recordings per case."""


def held(diagnosis: ema.Diagnosis, truth: Array) -> list[Flags]:
    """Return for each component whether its 95 % interval holds the truth (8,)."""
    return [holds(name, diagnosis.interval[name], true) for name, true in zip(NAMES, truth, strict=True)]


def measure(count: int, sizes: Sequence[int], channels: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Return a row of text for each number of recordings, over `count` cases."""
    actuator, rig = ema.Actuator.thesis(), Rig(label="base setting", channels=channels)
    diagnoses: dict[int, list[tuple[ema.JointDiagnosis, Array]]] = {size: [] for size in sizes}
    for case in range(count):
        faults = cases.random_faults(case)
        recordings = [
            recorded(rig, actuator, Manoeuvre(), faults, SEEDS * case + i) for i in range(max(sizes))
        ]
        for size in sizes:
            diagnoses[size].append((ema.diagnose_joint(recordings[:size], actuator), faults.vector))
    errors = {
        size: np.array([[component.standard_error for component in d.components.values()] for d, _ in items])
        for size, items in diagnoses.items()
    }
    return [
        (
            str(size),
            f"{100 * np.mean([held(d, truth) for d, truth in items]):.0f} %",
            f"{np.median(errors[size] / errors[sizes[0]]):.2f}",
            f"{(sizes[0] / size) ** 0.5:.2f}",
            str(sum(d.explained for d, _ in items)),
            str(sum(bool(d.contradicting) for d, _ in items)),
        )
        for size, items in diagnoses.items()
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=24)
    parser.add_argument("--sizes", default="1,4,8")
    parser.add_argument("--channels", default="current_A,voltage_V")
    options = parser.parse_args()
    sizes = [int(size) for size in options.sizes.split(",")]
    header = ("recordings", "held", "standard error, relative", "1/√n", "explained", "one named")
    print(format_table(header, measure(options.cases, sizes, tuple(options.channels.split(",")))))


if __name__ == "__main__":
    main()
