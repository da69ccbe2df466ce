"""A real machine: identify the EMPS from its recording in two ways, then diagnose that recording.

    python examples/emps/emps.py [DATA_EMPS.mat] [--judge DATA_EMPS_PULSES.mat] [--figure FILE]

The data set is public: Janot, Gautier, Brunot, "Data Set and Reference Models of EMPS", Workshop on
Nonlinear System Identification Benchmarks, 2019, at https://www.nonlinearbenchmark.org. Without a path, the
folder named by the environment variable EMAPHM_DATA is searched, else `../shared/data` next to the project.

The second file of the data set has pulses of an external force, `pulses_N`. Which sign they have, or whether
the drive command holds them already, the motion says: the way is taken that leaves the least force error.
"""

import argparse
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import emaphm as ema
from emaphm.actuator.channels import ChannelEntry
from emaphm.estimation.inverse_dynamics import controller_check, inverse_dynamics

HERE = Path(__file__).resolve().parent
DATA = Path(os.environ.get("EMAPHM_DATA", HERE.parents[2] / "shared" / "data"))

FREE = ("inertia", "viscous", "viscous_asymmetry", "coulomb", "offset", "transition_speed")

FORWARD, BACKWARD = (166.71, 20.144), (240.42, 20.628)
"""Viscous friction [N·s/m] and Coulomb friction [N] in either direction, by the authors of the data set."""

LINEAR = ("inertia", "viscous", "coulomb", "offset")
"""Enough to see which way a known force acts."""

PULSES = "pulses_N"
"""Column of a known external force [N], which the second file of the data set has."""

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
    parser.add_argument("--judge", type=Path, help="diagnose this recording in place of the first one")
    parser.add_argument("--figure", type=Path, default=Path("emps.svg"))
    arguments = parser.parse_args()

    described = ema.Actuator.from_toml(HERE / "emps.toml")
    recording = read(arguments.recording, described)
    judged = recording if arguments.judge is None else read(arguments.judge, described)

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

    print(*(f"Warning: {warning}" for warning in calibration.warnings), "", sep="\n")
    if judged is recording:
        print(
            "The same recording, diagnosed against what was calibrated on it: healthy is what it was then.\n"
        )
    else:
        print(f"{arguments.judge.name}, diagnosed against the description calibrated on the first file:\n")
    print(ema.diagnose(judged, calibration.actuator, seed=0))


def read(path: Path, described: ema.Actuator) -> ema.Recording:
    """Return a recording; with its pulses as a load, where it has some that lower the force error."""
    pulses = described.channels.model_copy(update={"load_Nm": ChannelEntry(column=PULSES)})
    try:
        loaded = ema.read_recording(path, described.model_copy(update={"channels": pulses}))
    except ema.EmaphmError:  # no pulses; anything else is said by reading it without
        return ema.read_recording(path, described)
    channels = {name: loaded[name] for name in loaded}
    load = channels.pop("load_Nm")
    ways = {
        "taken as a force against the motor": {"load_Nm": load},
        "taken as a force with the motor": {"load_Nm": -load},
        "left out": {},
    }
    recordings = {
        way: ema.Recording(channels | known, loaded.sampling, loaded.source, loaded.notes)
        for way, known in ways.items()
    }
    errors = {way: inverse_dynamics(one, described, LINEAR).relative_error for way, one in recordings.items()}
    best = min(errors, key=errors.__getitem__)
    said = ", ".join(f"{way} {100 * error:.2f} %" for way, error in errors.items())
    print(f"{path.name}: {PULSES} {best}; force error: {said}.\n")
    return recordings[best]


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
