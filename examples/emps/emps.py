"""A real machine: identify the EMPS from its recording in two ways, then diagnose that recording.

    python examples/emps/emps.py [DATA_EMPS.mat] [--figure FILE]

The data set is public: Janot, Gautier, Brunot, "Data Set and Reference Models of EMPS", Workshop on
Nonlinear System Identification Benchmarks, 2019, at https://www.nonlinearbenchmark.org. Without a path, the
folder named by the environment variable EMAPHM_DATA is searched, else `../shared/data` next to the project.
"""

import argparse
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import emaphm as ema
from emaphm.estimation.inverse_dynamics import controller_check, inverse_dynamics

HERE = Path(__file__).resolve().parent
DATA = Path(os.environ.get("EMAPHM_DATA", HERE.parents[2] / "shared" / "data"))

FREE = ("inertia", "viscous", "viscous_asymmetry", "coulomb", "offset", "transition_speed")

FORWARD, BACKWARD = (166.71, 20.144), (240.42, 20.628)
"""Viscous friction [N·s/m] and Coulomb friction [N] in either direction, by the authors of the data set."""

PUBLISHED = {
    "inertia": 95.1089,
    "viscous": (FORWARD[0] + BACKWARD[0]) / 2,
    "viscous_asymmetry": (FORWARD[0] - BACKWARD[0]) / (FORWARD[0] + BACKWARD[0]),
    "coulomb": (FORWARD[1] + BACKWARD[1]) / 2,
    "offset": (FORWARD[1] - BACKWARD[1]) / 2,
}
"""The same in the units of the calibration."""

PUBLISHED_FORCE_ERRORS = {"measured motion": 0.03112, "closed loop": 0.05848}
"""Relative force errors of the authors: inverse dynamics with unequal friction, and their simulation."""


def main() -> None:
    """Identify in both ways, compare with the published values, draw, diagnose."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", nargs="?", type=Path, default=DATA / "emps" / "DATA_EMPS.mat")
    parser.add_argument("--figure", type=Path, default=Path("emps.svg"))
    arguments = parser.parse_args()

    described = ema.Actuator.from_toml(HERE / "emps.toml")
    recording = ema.read_recording(arguments.recording, described)

    check = controller_check(recording, described)
    print(
        f"The described control law misses the recorded drive command by {100 * check.relative_error:.2f} %: "
        f"it {'contradicts' if check.contradicts else 'agrees with'} the recording.\n"
    )

    measured_motion = inverse_dynamics(recording, described, FREE)
    print("From the measured motion (inverse dynamics):\n")
    show(measured_motion.parameters, "measured motion", measured_motion.relative_error)

    calibration = ema.calibrate(recording, described, FREE)
    print("Calibrated in closed loop, from the command alone:\n")
    show(calibration.parameters, "closed loop", calibration.relative_error["current_A"])
    calibration.plot().savefig(arguments.figure)
    print(f"Measured against model drawn in {arguments.figure}\n")

    print("The same recording, diagnosed against the calibrated description:\n")
    print(ema.diagnose(recording, calibration.actuator, seed=0))


def show(parameters: Mapping[str, Any], way: str, force_error: float) -> None:
    """Print parameters with standard errors, and the force error, next to the published ones."""
    for name, found in parameters.items():
        line = f"  {name:<17} {found.value:10.4g} ± {found.standard_error:<8.2g} {found.unit:<6}"
        print(f"{line} published {PUBLISHED[name]:.4g}" if name in PUBLISHED else line)
    published = 100 * PUBLISHED_FORCE_ERRORS[way]
    print(f"  relative force error {100 * force_error:.2f} %, published {published:.2f} %\n")


if __name__ == "__main__":
    try:
        main()
    except ema.EmaphmError as error:
        sys.exit(f"error: {error}")
