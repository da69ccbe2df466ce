"""
A first diagnosis
=================

From a recording to the faults that explain it. The recording is of a simulated actuator, so the result can be
compared with the truth.
"""

# %%
# The actuator
# ------------
#
# The built-in description is the three-phase actuator of the thesis that this package starts from: a
# brushless motor under hysteresis current control, a gear, and a position loop. Yours is described in a TOML
# file of the same form: ``emaphm init rig.toml`` writes a first one.

import emaphm as ema

actuator = ema.Actuator.thesis()

# %%
# A recording
# -----------
#
# The reference model switches its inverter every microsecond. The command is a sine sweep (a chirp) of half a
# second. The currents get 0.05 A of noise and 12-bit converters. This unit has more friction than a new one,
# and shorted turns in one phase.

chirp = ema.Chirp(amplitude=5e-3, stop_hz=15)
truth = ema.Faults(friction=0.30, short_b=0.20)
simulated = ema.simulate(actuator, chirp, faults=truth, noise=0.05, adc_bits=12, seed=1)
recorded = ("time_s", "command_rad", "current_A", "voltage_V")
recording = ema.Recording({name: simulated[name] for name in recorded})
print(recording)

# %%
# The diagnosis
# -------------
#
# Load and winding temperature are unknown to the diagnosis, so they are estimated with the faults. Each fault
# comes with a 95 % interval and a verdict.

diagnosis = ema.diagnose(recording, actuator, seed=0)
print(diagnosis)

# %%
# The figure shows the recording, the model with the estimated faults, what remains between them, and the
# estimates.

figure = diagnosis.plot()

# %%
# The error as the thesis defines it, over all eight components, in percent:

print(f"{ema.error_percent(truth.vector, diagnosis.faults.vector):.2f} %")

# %%
# Fewer channels
# --------------
#
# From the current alone, a short in all three phases looks like warm windings. The intervals become wider,
# and the notes below the table name what is known only in combination, with the channel that would separate
# it.

current_only = ema.Recording({name: simulated[name] for name in recorded[:3]})
print(ema.diagnose(current_only, actuator, seed=0))

# %%
# When the description is wrong
# -----------------------------
#
# The inertia of this unit is a tenth larger than its description says, and the diagnosis does not know. With
# the line voltage recorded it sees that something is off, estimates the inertia too, and says so in its last
# lines.

inertia = 1.1 * actuator.mechanics.inertia_motor
heavier = actuator.changed({"mechanics.inertia_motor": inertia})
simulated = ema.simulate(heavier, chirp, faults=truth, noise=0.05, adc_bits=12, seed=2)
recording = ema.Recording({name: simulated[name] for name in recorded})
print(ema.diagnose(recording, actuator, seed=0))
