"""
A fleet: from recordings to remaining useful life and its page
==============================================================

Four units fly. Each recording is diagnosed and kept in a history; the history gives the distribution of the
time until a unit no longer does what is required of it, and a page on which the most urgent unit is first.
All flights here are simulated: each unit wears in a way of its own.
"""

# %%
# What the actuator must do
# -------------------------
#
# A requirement is a level of a fault that a manual gives, or a measure of what the actuator does. They stand
# in the actuator's TOML as ``[[requirements]]``.

import json
import re
import subprocess
import tempfile
import time
from pathlib import Path
from urllib.request import urlopen

import emaphm as ema
from emaphm.history import Entry, Finding, History, Removal
from emaphm.prognosis import Evidence, Question, failure_levels, learnt_prior, prognose

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
# Five flights of four units
# --------------------------
#
# Each flight's recording is diagnosed and added. A history is a file, or a PostgreSQL database by its
# address. In service, ``emaphm watch`` does this with the recordings that arrive.

db = Path(tempfile.mkdtemp()) / "fleet.sqlite"
history = History.open(db, create=True)

wear = {  # friction and backlash of the first flight, and what each flight adds
    "SN-0041": (0.02, 0.05, 0.002, 0.002),
    "SN-0042": (0.02, 0.10, 0.015, 0.09),
    "SN-0043": (0.02, 0.05, 0.035, 0.01),
    "SN-0044": (0.02, 0.30, 0.010, 0.10),
}


def faults(name: str, flight: int) -> ema.Faults:
    """Return the faults of a unit on a flight; SN-0044 is replaced after its third."""
    friction, backlash, more_friction, more_backlash = wear[name]
    if name == "SN-0044" and flight > 2:
        flight, backlash = flight - 3, 0.05
    return ema.Faults(friction=friction + more_friction * flight, backlash=backlash + more_backlash * flight)


for number, name in enumerate(wear):
    for flight in range(5):
        hours, seed = 200.0 * (flight + 1), 10 * number + flight
        recording = ema.simulate(actuator, ema.Chirp(), faults=faults(name, flight), noise=0.05, seed=seed)
        history.add(Entry(name, actuator.name, hours), recording, ema.diagnose(recording, actuator, seed=0))

history.add_removal("SN-0044", Removal(600.0, "suspected", "slow to respond"))
history.add_finding("SN-0044", Finding(600.0, "unit", "degraded", replaced=True))

for unit in history.units():
    levels = [f"{one.vector[0]:.2f}/{one.vector[1]:.2f}" for one in unit.diagnoses()]
    print(unit.serial_number, "friction/backlash", *levels)

# %%
# How long a unit will last
# -------------------------
#
# The degradation filter follows level and rate of each component under several laws at once, with the full
# covariance of each diagnosis. The other units of the part number show which rates are usual. From its
# state, a thousand futures are drawn; the remaining useful life (RUL) is the time at which the first
# requirement fails.

unit = history.unit("SN-0042")
prior = learnt_prior(history, unit)
prognosis = prognose(Evidence.of(unit), actuator, Question(horizon=500.0), prior=prior, seed=0)
print(prognosis)

# %%

figure = prognosis.plot()
history.close()

# %%
# The page of the fleet
# ---------------------
#
# ``emaphm serve --db fleet.sqlite`` shows the history in a browser, and gives other software the same by
# HTTP. It makes the prognoses of all units by itself; here we wait for them.

server = subprocess.Popen(["emaphm", "serve", "--db", db, "--port", "0", "--json"], stdout=subprocess.PIPE)
address = json.loads(server.stdout.readline())["url"]
fleet = []
while not fleet or not all(one["current"] for one in fleet):
    time.sleep(0.5)
    fleet = json.load(urlopen(f"{address}api/v1/units"))["units"]

for one in fleet:
    print(f"{one['unit']}: {one['advice']} (at {one['advice_at']:.0f} h); RUL {one['rul']:.0f} h")

# %%
# The table of the page, the most urgent unit first. On the page itself its headings sort, a unit leads to its
# health over flight hours, and a diagnosis to its intervals.

page = urlopen(address).read().decode()
server.terminate()
server.wait()


class Table:
    """The table of the page, without its links."""

    def _repr_html_(self) -> str:
        found = re.search("<table.*</table>", page, re.DOTALL)
        return re.sub("</?a[^>]*>", "", found.group())


Table()
