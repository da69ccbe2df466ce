"""The recordings for the evaluation of an estimator: on rigs, of foreign plants, and spoilt recordings."""

from collections.abc import Iterator
from dataclasses import dataclass

from emaphm.actuator import Faults
from emaphm.study.cases import Group, SmallFaults, random_faults
from emaphm.study.plan import Plan
from emaphm.study.rig import Rig
from emaphm.study.spoilt.run import cases as spoilt_cases

COUNTS = {"random": 300, "heavy": 300, "healthy": 500, "small": 50}
"""Recordings per group, for small faults per kind; as in the plan `accuracy` except for heavy shorts."""

GROUPS = (*COUNTS, "multiple", "foreign", "spoilt")
"""Groups of recordings, as in `RecordingCase.group`."""

SMALL = 0.05
"""Size of the small faults."""

MULTIPLE = 10
"""Number of recordings of the thesis's multiple faults."""

FOREIGN_EACH = 20
"""Number of recordings per foreign plant."""


@dataclass(frozen=True)
class RecordingCase:
    """A recording of a `group`: of the faults `truth` on a rig, or without a rig the spoilt case `number`."""

    group: str
    label: str
    truth: tuple[float, ...]
    rig: Rig | None
    number: int


def of_base_setting(channels: tuple[str, ...], share: float) -> Iterator[RecordingCase]:
    """Yield the cases on the base setting."""
    rig = Rig(label="base", channels=channels)
    count = {name: max(1, round(share * number)) for name, number in COUNTS.items()}
    small = SmallFaults(size=SMALL, count=count.pop("small"))
    for case in Group(label="base", small=(small,), **count).all_cases({}, seed=0):
        label = case.name.partition(" ")[0]  # of a small fault, its kind
        yield RecordingCase(case.kind, label, case.truth, rig, case.number)


def of_multiple(channels: tuple[str, ...]) -> Iterator[RecordingCase]:
    """Yield the thesis's multiple faults in its conditions, if `channels` is the current alone as there.

    The recordings differ in their switching, as in the plan `accuracy`.
    """
    plan = Plan.load("accuracy")
    rig = next(rig for rig in plan.rigs if rig.label == "switching disturbed")
    if channels == rig.channels:
        faults = Faults.from_mapping(plan.cases["multiple"])
        for n in range(MULTIPLE):
            yield RecordingCase("multiple", "multiple", tuple(map(float, faults.vector)), rig, n)


def of_unlike(channels: tuple[str, ...], share: float) -> Iterator[RecordingCase]:
    """Yield recordings that differ from all simulations: of foreign plants, and spoilt recordings."""
    foreign = [rig for rig in Plan.load("plants").rigs if rig.foreign is not None and not rig.calibrated]
    for rig in foreign:
        with_channels = rig.model_copy(update={"channels": channels})
        for n in range(max(1, round(share * FOREIGN_EACH))):
            truth = tuple(map(float, random_faults(n).vector))
            yield RecordingCase("foreign", rig.label, truth, with_channels, n)
    for n, case in enumerate(spoilt_cases()):
        if case.channels == "voltage" and n % max(1, round(1 / share)) == 0:
            yield RecordingCase("spoilt", case.spoilt_class, (), None, n)
