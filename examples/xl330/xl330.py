"""A real servo: fit a Dynamixel XL330 with a pendulum on some logs, and predict others from their goal alone.

    python examples/xl330/xl330.py [--train FILE …] [--test FILE …] [--figure FILE] [--json]

Logs by Rhoban/bam (Duclusaud, Passault, Padois, Ly, arXiv 2410.08650) as CSV files; the name of a file begins
with the gain of the drive, "kp400_". Without paths, the folder named by the environment variable EMAPHM_DATA
is searched, else `../shared/data` next to the project.
"""

import argparse
import json
import math
import os
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import emaphm as ema
from emaphm.actuator.laws import law_named, laws_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from emaphm.estimation.replay import Replay

HERE = Path(__file__).resolve().parent
DATA = Path(os.environ.get("EMAPHM_DATA", HERE.parents[2] / "shared" / "data")) / "xl330"

TRAIN = (
    "kp100_sin_sin.csv",
    "kp200_lift_and_drop.csv",
    "kp400_up_and_down.csv",
    "kp800_sin_time_square.csv",
)
TEST = (
    "kp100_up_and_down.csv",
    "kp200_sin_time_square.csv",
    "kp400_sin_sin.csv",
    "kp800_lift_and_drop.csv",
)

DUTY_PER_KP = 4096 / (2 * math.pi) / (256 * 885)
"""Duty cycle per position error and unit of kp [1/rad]: counts a turn, divisor of kp, counts at full duty."""

LAWS = ("load-dependent", "source-resistance", "winding-temperature")
"""Laws, with the weight, that lower the error of logs left out of the fit; Stribeck, quadratic and unequal
friction do not."""

FREE = ("inertia", "viscous", "coulomb", "torque_constant", "resistance", "gravity_angle")
"""Free, with the parameters of the laws. The weight is known, which gives the torques their scale."""


@dataclass(frozen=True)
class Fit:
    """A calibration of the servo; replays of the logs that it was fitted to, and of those left out."""

    calibration: ema.Calibration
    train: tuple["Replay", ...]
    test: tuple["Replay", ...]

    def to_dict(self) -> dict[str, float | list[str]]:
        """Return the errors of the position [mrad], means over logs, and the names of the laws."""
        return {
            "train_mae_mrad": _mean_absolute_mrad(self.train),
            "test_mae_mrad": _mean_absolute_mrad(self.test),
            "test_rms_mrad": 1e3
            * float(np.sqrt(np.mean([one.rms_error["position_rad"] ** 2 for one in self.test]))),
            "laws": list(laws_of(self.calibration.actuator)),
        }


def campaign_row(path: Path, actuator: ema.Actuator) -> ema.CampaignRow:
    """Return a log's command, position and drive enable, with its gain and the temperature of the housing."""
    named = re.match(r"kp(\d+)_", path.name)
    if named is None:
        raise SystemExit(f"{path}: the name does not begin with the gain, such as kp400_; rename the file")
    log = ema.read_recording(path, actuator)
    channels = {name: log[name] for name in ("time_s", "command_rad", "position_rad", "enabled")}
    known = {
        "position_gain": DUTY_PER_KP * float(named[1]),
        "temperature": 273.15 + float(np.mean(log["temperature_degC"])),
    }
    return ema.CampaignRow(ema.Recording(channels, log.sampling, path.stem, log.notes), known)


def fit(train: Sequence[Path], test: Sequence[Path], seed: int = 0) -> Fit:
    """Return the fit to the logs `train`, and what it predicts of `test`."""
    actuator = ema.Actuator.from_toml(HERE / "xl330.toml")
    rows = {path: campaign_row(path, actuator) for path in (*train, *test)}
    free = [*FREE, *(name for law in LAWS for name in law_named(law).parameters)]
    for law in LAWS:
        actuator = law_named(law).added_to(actuator)
    calibration = ema.calibrate(
        [rows[path] for path in train], actuator, free, nuisances=(), max_corrections=0, seed=seed
    )

    def replayed(paths: Sequence[Path]) -> tuple["Replay", ...]:
        return tuple(
            ema.replay(rows[path].completed(), rows[path].described(calibration.actuator)) for path in paths
        )

    return Fit(calibration, replayed(train), replayed(test))


def draw(found: Fit) -> "Figure":
    """Draw the goal, the measured and the modelled position of each log that was left out."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        len(found.test), 1, figsize=(8, 2 * len(found.test)), sharex=True, squeeze=False
    )
    for one, ax in zip(found.test, axes[:, 0], strict=True):
        time = one.recording["time_s"]
        ax.plot(time, one.recording["command_rad"], color="0.7", label="goal")
        ax.plot(time, one.recording["position_rad"], label="measured")
        ax.plot(time, one.signals["position_rad"], "--", label="model")
        error = 1e3 * one.mean_absolute_error["position_rad"]
        ax.set_title(f"{one.recording.source}: mean absolute error {error:.0f} mrad", fontsize="medium")
        ax.set_ylabel("position [rad]")
    axes[0, 0].legend(loc="upper right")
    axes[-1, 0].set_xlabel("time [s]")
    figure.tight_layout()
    return figure


def main() -> None:
    """Fit, predict, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--train", nargs="+", type=Path, default=[DATA / name for name in TRAIN])
    parser.add_argument("--test", nargs="+", type=Path, default=[DATA / name for name in TEST])
    parser.add_argument("--figure", type=Path, help="draw the logs left out of the fit")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()

    found = fit(arguments.train, arguments.test, arguments.seed)
    if arguments.figure:
        draw(found).savefig(arguments.figure)
    if arguments.json:
        print(json.dumps(found.to_dict()))
        return
    print(found.calibration)
    for title, replays in (("fitted to", found.train), ("left out of the fit", found.test)):
        print(f"\nLogs {title}, mean absolute error of the position:")
        for one in replays:
            print(f"  {one.recording.source:<24} {1e3 * one.mean_absolute_error['position_rad']:6.1f} mrad")
        print(f"  {'mean':<24} {_mean_absolute_mrad(replays):6.1f} mrad")


def _mean_absolute_mrad(replays: Sequence["Replay"]) -> float:
    return 1e3 * float(np.mean([one.mean_absolute_error["position_rad"] for one in replays]))


if __name__ == "__main__":
    try:
        main()
    except ema.EmaphmError as error:
        sys.exit(f"error: {error}")
