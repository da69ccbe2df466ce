"""The fingerprint of a unit's evidence and the keys of cached results, against a change of any field."""

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
"""A changed value of each field."""


def changed() -> Iterator[tuple[str, Evidence]]:
    """Yield the evidence with one changed field, of the unit or of its last observation."""
    for field in fields(Evidence):
        yield field.name, replace(EVIDENCE, **{field.name: OF_UNIT[field.name]})
    for field in fields(Observation):
        last = replace(OBSERVATIONS[-1], **{field.name: OF_OBSERVATION[field.name]})
        yield f"observation's {field.name}", replace(EVIDENCE, observations=(*OBSERVATIONS[:3], last))


CHANGED = [pytest.param(evidence, id=name) for name, evidence in changed()]


def predicted(unit: Evidence, other: Evidence) -> str:
    setup = PredictionSetup(THESIS, 1000.0, 0)
    return keys_of([unit], Fleet.of([unit, other], 0), setup)[0]


def judged(unit: Evidence, other: Evidence, larger: Evidence) -> str:
    plan = FleetPlan(units=2)
    fleet = KnownFleet("fleet", (other,), (500.0,), (larger,))
    return Work("recorded", fleet, plan, drawn_unit(plan, 0), unit).key("code")


@pytest.mark.parametrize("other", CHANGED)
def test_a_change_of_any_field_changes_the_fingerprint(other: Evidence) -> None:
    copy = replace(EVIDENCE, observations=tuple(replace(observation) for observation in OBSERVATIONS))
    assert fingerprint(EVIDENCE) == fingerprint(copy) != fingerprint(other)


@pytest.mark.parametrize("other", CHANGED)
def test_keys_of_cached_results_change_with_any_evidence_that_they_depend_on(other: Evidence) -> None:
    """The evidence is that of a unit, of the other units of its fleet, or of a larger fleet."""
    same = EVIDENCE
    cases = (same, same, same), (other, same, same), (same, other, same), (same, same, other)
    assert len({judged(*case) for case in cases}) == len(cases)
    fellow, unit = replace(other, unit=f"fellow {other.unit}"), replace(EVIDENCE, unit="fellow A")
    assert predicted(EVIDENCE, unit) != predicted(EVIDENCE, fellow)
    assert predicted(EVIDENCE, replace(EVIDENCE, unit="C")) != predicted(other, replace(EVIDENCE, unit="C"))
