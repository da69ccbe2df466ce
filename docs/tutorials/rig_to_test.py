"""
Your rig: from a description to the design of the test
======================================================

A machine is described by what its data sheet says, calibrated from recordings of the healthy unit, and tested
by a command that shows its faults. Here the machine is simulated: its friction and inertia are not those of
the data sheet.
"""

# %%
# The description
# ---------------
#
# ``emaphm init rig.toml --from pmsm`` writes a file like this one: a permanent-magnet motor under
# field-oriented control. We take the built-in one of that kind.

import emaphm as ema

described = ema.Actuator.pmsm()
print(described.mechanics.inertia_motor, described.mechanics.viscous_motor)

# %%
# Recordings of the healthy machine
# ---------------------------------
#
# The true machine differs from its description: more inertia, less viscous friction.

machine = described.changed(
    {
        "mechanics.inertia_motor": 1.15 * described.mechanics.inertia_motor,
        "mechanics.viscous_motor": 0.7 * described.mechanics.viscous_motor,
    }
)
chirps = [ema.Chirp(amplitude=5e-3, stop_hz=15), ema.Chirp(amplitude=3e-3, stop_hz=25)]


def recorded(chirp: ema.Chirp, faults: ema.Faults, seed: int) -> ema.Recording:
    """Return what a logger keeps of a run: command, current and line voltage."""
    run = ema.simulate(machine, chirp, faults=faults, noise=0.05, adc_bits=12, seed=seed)
    return ema.Recording({name: run[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")})


healthy = [recorded(chirp, ema.Faults(), seed) for seed, chirp in enumerate(chirps * 2)]

# %%
# Calibration
# -----------
#
# One fit of all recordings. Each value comes with its error; what the recordings cannot show is said.

calibration = ema.calibrate(healthy, described, free=["inertia", "viscous", "coulomb"], seed=0)
print(calibration)

# %%
# The calibrated unit carries how well its parameters are known, so that later diagnoses do not take that
# uncertainty for a fault.

unit = calibration.actuator
print(unit.baseline.names)

# %%
# Which command shows the faults
# ------------------------------
#
# The design predicts the width of each interval for a command, looks for a better one within its limits, and
# confirms both by simulated tests.

design = ema.design(unit, chirps[0], channels=["current"], candidates=12, tests=4, seed=0)
print(design)

# %%
# A test with faults
# ------------------

faulty = recorded(chirps[0], ema.Faults(friction=0.2, backlash=0.3), seed=9)
print(ema.diagnose(faulty, unit, seed=0))
