"""
A unit: from recordings to its remaining useful life
====================================================

Diagnoses of a unit over its flights are a history. The history gives the distribution of the time until the
actuator no longer does what is required of it. All flights here are simulated: friction and backlash grow.
"""

# %%
# What the actuator must do
# -------------------------
#
# A requirement is a level of a fault that a manual gives, or a measure of what the actuator does. They stand
# in the actuator's TOML as ``[[requirements]]``.

import tempfile
from pathlib import Path

import emaphm as ema
from emaphm.history import Entry, History
from emaphm.prognosis import Evidence, Question, failure_levels, prognose

thesis = ema.Actuator.thesis()
requirements = [
    {"component": "backlash", "at_most": 0.6},
    {"measure": "tracking_error", "at_most": 9.5e-4, "name": "follows the chirp"},
]
actuator = ema.Actuator.from_dict(
    {**thesis.model_dump(mode="json", exclude_none=True), "requirements": requirements}
)
for one in failure_levels(actuator):
    print(one.limit.label, one.value, one.levels["friction"], one.levels["backlash"])

# %%
# Ten flights
# -----------
#
# Each flight's recording is diagnosed and added. A history is a file, or a PostgreSQL database by its
# address.

folder = Path(tempfile.mkdtemp())
history = History.open(str(folder / "history.sqlite"), create=True)
for flight in range(10):
    hours = 100.0 * (flight + 1)
    faults = ema.Faults(friction=0.02 + 0.01 * flight, backlash=0.05 + 0.04 * flight)
    recording = ema.simulate(actuator, ema.Chirp(), faults=faults, noise=0.05, seed=flight)
    diagnosis = ema.diagnose(recording, actuator, seed=0)
    history.add(Entry("SN-0042", actuator.name, hours), recording, diagnosis)

unit = history.unit("SN-0042")
for one in unit.diagnoses():
    friction, backlash = one.vector[:2]
    print(f"{one.hours:6.0f} h  friction {friction:.3f}  backlash {backlash:.3f}  explained {one.explained}")

# %%
# How long it will last
# ---------------------
#
# The degradation filter follows level and rate of each component under several laws at once, with the full
# covariance of each diagnosis. From its state, thousands of futures are drawn; the remaining useful life is
# the time at which the first requirement fails.

prognosis = prognose(Evidence.of(unit), actuator, Question(horizon=500.0), seed=0)
print(prognosis)

# %%

figure = prognosis.plot()
history.close()
