"""A real machine: calibrate the EMPS on its recording, then diagnose that recording.

    python examples/emps/emps.py [DATA_EMPS.mat] [--figure FILE]

The data set is public: Janot, Gautier, Brunot, "Data Set and Reference Models of EMPS", Workshop on
Nonlinear System Identification Benchmarks, 2019, at https://www.nonlinearbenchmark.org. Without a path, the
folder named by the environment variable EMAPHM_DATA is searched, else `../shared/data` beside the project.
"""

import argparse
import os
from pathlib import Path

import emaphm as ema

HERE = Path(__file__).resolve().parent
DATA = Path(os.environ.get("EMAPHM_DATA", HERE.parents[2] / "shared" / "data"))

PUBLISHED = {"inertia": 95.1089, "viscous": 203.5034, "coulomb": 20.3935, "offset": -3.1648}
"""Identified by the authors of the data set, in the units of the calibration."""

PUBLISHED_FORCE_ERROR = 0.0585
"""Relative force error of their closed-loop simulation."""


def main() -> None:
    """Calibrate, compare with the published values, draw, diagnose."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", nargs="?", type=Path, default=DATA / "emps" / "DATA_EMPS.mat")
    parser.add_argument("--figure", type=Path, default=Path("emps.svg"))
    arguments = parser.parse_args()

    described = ema.Actuator.from_toml(HERE / "emps.toml")
    recording = ema.read_recording(arguments.recording, described)
    calibration = ema.calibrate(recording, described, list(PUBLISHED))

    print("Calibrated, beside the published values:\n")
    for name, published in PUBLISHED.items():
        found = calibration.parameters[name]
        print(
            f"  {name:<8} {found.value:9.3f} ± {found.standard_error:.2g} {found.unit:<6} "
            f"published {published:9.3f}, {100 * (found.value / published - 1):+.2f} %"
        )
    print(
        f"  relative force error {100 * calibration.relative_error['current_A']:.2f} %, "
        f"published {100 * PUBLISHED_FORCE_ERROR:.2f} %\n"
    )
    calibration.plot().savefig(arguments.figure)
    print(f"Measured against model drawn in {arguments.figure}\n")

    print("The same recording, diagnosed against the calibrated description:\n")
    print(ema.diagnose(recording, calibration.actuator, seed=0))


if __name__ == "__main__":
    main()
