"""A described PMSM under field-oriented control: record it with faults as a rig would, then diagnose it.

    python examples/pmsm/pmsm.py [--figure FILE]

The recording is made by the reference model, with the PWM's ripple, noise, 12-bit converters and a load that
the diagnosis does not know.
"""

import argparse
import sys
from pathlib import Path

import emaphm as ema

HERE = Path(__file__).resolve().parent

FAULTS = ema.Faults(
    friction=0.3, backlash=0.2, short_b=0.15, eccentricity=0.4, eccentricity_phase=0.7, gain=0.4
)
LOAD_NM = 0.1


def main() -> None:
    """Simulate, diagnose, compare with the truth, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--figure", type=Path, default=Path("pmsm.svg"))
    arguments = parser.parse_args()

    actuator = ema.Actuator.from_toml(HERE / "pmsm.toml")
    whole = ema.simulate(actuator, ema.Chirp(), faults=FAULTS, load=LOAD_NM, noise=0.05, adc_bits=12, seed=1)
    names = ("time_s", "command_rad", "current_A", "voltage_V")
    recording = ema.Recording({name: whole[name] for name in names})
    diagnosis = ema.diagnose(recording, actuator, seed=0)

    print(diagnosis)
    error = float(ema.error_percent(FAULTS.vector, diagnosis.faults.vector))
    print(f"\nError against the faults that were simulated: {error:.2f} %")
    diagnosis.plot().savefig(arguments.figure)
    print(f"Diagnosis drawn in {arguments.figure}")


if __name__ == "__main__":
    try:
        main()
    except ema.EmaphmError as error:
        sys.exit(f"error: {error}")
