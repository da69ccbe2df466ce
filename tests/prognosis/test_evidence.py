"""What identifies a unit's evidence: a change of any of its fields is seen, by all that keep results."""

from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from cases import THESIS
from emaphm.fleet.synthetic import FleetPlan, drawn_unit
from emaphm.fleet.synthetic.prediction import PredictionSetup, keys_of
from emaphm.history.lives import Failure, OpenRemoval
from emaphm.prognosis import Evidence, Observation, Stress, StressPiece
from emaphm.prognosis.from_fleet.fingerprint import fingerprint
from emaphm.prognosis.from_fleet.fleet import Fleet
from emaphm.study.fleet.run import KnownFleet, Work

OBSERVATIONS = tuple(
    Observation(100.0 * i, np.full(8, 0.1 * i), 1e-4 * np.eye(8), np.ones(8, bool)) for i in range(1, 5)
)
EVIDENCE = Evidence("A", "P", 400.0, OBSERVATIONS)

OF_OBSERVATION: dict[str, Any] = {
    "hours": 401.0,
    "level": np.full(8, 0.4 + 1e-15),
    "covariance": 2e-4 * np.eye(8),
    "seen": np.arange(8) > 0,
    "explained": False,
    "shared": 1e-5 * np.eye(8),
    "load": 0.1,
}
OF_UNIT: dict[str, Any] = {
    "unit": "B",
    "part_number": "Q",
    "hours": 401.0,
    "observations": OBSERVATIONS[:3],
    "replacements": ((400.0, "friction"),),
    "stresses": (StressPiece(0.0, 400.0, Stress(cycles_per_hour=2.0)),),
    "components": 7,
    "failures": (400.0,),
    "unrepaired": Failure(400.0, ("friction",)),
    "not_replaced": (Failure(400.0, ("friction",)),),
    "open_removal": OpenRemoval(400.0, ("gain",)),
    "contradictions": ("friction was found healthy",),
    "description_notes": ("its inertia is unlike that of other units",),
}
"""Another value of each field."""


def changed() -> Iterator[tuple[str, Evidence]]:
    """Yield the evidence with another value of one of its fields, or of those of its last observation."""
    for one in fields(Evidence):
        yield one.name, replace(EVIDENCE, **{one.name: OF_UNIT[one.name]})
    for one in fields(Observation):
        last = replace(OBSERVATIONS[-1], **{one.name: OF_OBSERVATION[one.name]})
        yield f"observation's {one.name}", replace(EVIDENCE, observations=(*OBSERVATIONS[:3], last))


CHANGED = [pytest.param(one, id=name) for name, one in changed()]


def predicted(unit: Evidence, other: Evidence) -> str:
    setup = PredictionSetup(THESIS, 1000.0, 0)
    return keys_of([unit], Fleet.of([unit, other], 0), setup)[0]


def judged(unit: Evidence, other: Evidence, larger: Evidence) -> str:
    plan = FleetPlan(units=2)
    fleet = KnownFleet("fleet", (other,), (500.0,), (larger,))
    return Work("recorded", fleet, plan, drawn_unit(plan, 0), unit).key("code")


@pytest.mark.parametrize("other", CHANGED)
def test_any_field_counts(other: Evidence) -> None:
    copy = replace(EVIDENCE, observations=tuple(replace(one) for one in OBSERVATIONS))
    assert fingerprint(EVIDENCE) == fingerprint(copy) != fingerprint(other)


@pytest.mark.parametrize("other", CHANGED)
def test_kept_results_are_of_the_same_evidence(other: Evidence) -> None:
    """Of a unit, of the others of its fleet, and of a larger fleet."""
    same = EVIDENCE
    cases = (same, same, same), (other, same, same), (same, other, same), (same, same, other)
    assert len({judged(*one) for one in cases}) == len(cases)
    fellow, unit = replace(other, unit=f"fellow {other.unit}"), replace(EVIDENCE, unit="fellow A")
    assert predicted(EVIDENCE, unit) != predicted(EVIDENCE, fellow)
    assert predicted(EVIDENCE, replace(EVIDENCE, unit="C")) != predicted(other, replace(EVIDENCE, unit="C"))
