"""What `make study` counts and writes: draws, rates, pages; its diagnoses are those of `diagnose`."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bench import base, exact, limits
from bench.accuracy import asked_and_reached
from bench.cases import (
    SINGLE,
    Case,
    Outcome,
    coverage,
    detection,
    diagnosed,
    false_alarms,
    holds,
    measured,
    random_faults,
    recordings_alarmed,
    small_fault,
)
from bench.limits import AXES, DEFAULT, FOREIGN, RECORDED, Axis, Curve, Figures, Setting, by_chance
from bench.limits_figures import draw
from bench.rig import BASE, EVERYTHING, IDEAL, Rig, actuator_on, recorded

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.actuator.lumped_parameters import lumped_parameters

GOOD: dict[str, Any] = {
    "error": 0.2,
    "covered": (True,) * 8,
    "half_widths": (0.01,) * 8,
    "alarms": (False,) * 8,
    "explained": True,
    "moves": True,
    "seconds": 0.1,
}


def outcome(case: Case, **values: Any) -> Outcome:
    return Outcome(case, **{**GOOD, **values})


def alarmed(*names: str) -> tuple[bool, ...]:
    return tuple(name in names for name in NAMES)


def test_the_same_seed_has_the_same_faults_and_loads_on_every_rig() -> None:
    offset = [
        lumped_parameters(actuator_on(rig, 5), ("offset",))["offset"]
        for rig in (BASE, replace(BASE, heat=(0.0, 0.0)), replace(BASE, inertia=(0.1, 0.1)))
    ]
    assert offset[0] == offset[1] == offset[2] != 0
    assert (
        np.ptp([lumped_parameters(actuator_on(BASE, seed), ("offset",))["offset"] for seed in range(50)])
        > 0.3
    )


def test_what_is_off_on_a_rig_is_off_by_what_it_says() -> None:
    rig = Rig(load=(0.1, 0.1), heat=(40.0, 40.0), supply=(-0.1, -0.1), inertia=(0.05, 0.05))
    names = ("offset", "resistance", "torque_constant", "supply", "inertia")
    nominal, got = lumped_parameters(Actuator.thesis(), names), lumped_parameters(actuator_on(rig, 0), names)
    # Copper gains 0.393 % a kelvin, NdFeB loses 0.11 %.
    factors = {"resistance": 1.1572, "torque_constant": 0.956, "supply": 0.9, "inertia": 1.05}
    assert got["offset"] == pytest.approx(0.1)
    for name, factor in factors.items():
        assert got[name] == pytest.approx(factor * nominal[name])


def test_a_rig_records_what_it_says() -> None:
    rig = replace(BASE, channels=EVERYTHING, sample_rate=1e3, duration=0.1, noise=0.0, adc_bits=8)
    recording = recorded(rig, Faults(), 0)
    assert recording.names == ("time_s", "command_rad", *EVERYTHING)
    assert recording.samples == 100
    step = 2 * 45.0 / 2**8  # twice twice the current limit, over 256 codes
    codes = recording["current_A"] / step
    np.testing.assert_allclose(codes, np.round(codes), atol=1e-9)


@pytest.mark.parametrize("kind", SINGLE)
def test_small_faults_are_single_and_as_small_as_they_say(kind: str) -> None:
    drawn = [small_fault(kind, 0.05, seed) for seed in range(30)]
    for faults in drawn:
        away = {n: abs(v) for n, v in zip(NAMES, faults.vector - Faults().vector, strict=True) if v}
        away.pop("eccentricity_phase", None)
        assert len(away) == 1
        assert next(iter(away)).startswith(kind)
        assert next(iter(away.values())) == pytest.approx(0.05)
    # All phases, both signs, many directions; the others have one form.
    forms = {"friction": 1, "backlash": 1, "short": 3, "eccentricity": 30, "gain": 2}
    assert len(set(drawn)) == forms[kind]


def test_a_phase_is_covered_across_the_cut_of_its_circle() -> None:
    assert holds((0.95, 1.05), 0.02, "eccentricity_phase")
    assert not holds((0.95, 1.05), 0.02, "gain")
    assert holds((-0.05, 0.05), 0.98, "eccentricity_phase")


def test_rates_count_what_they_are_named_after() -> None:
    short, none = Case(BASE, Faults(short_b=0.05), 0), Case(BASE, Faults(), 0)
    found = outcome(short, alarms=alarmed("short_b", "gain"))
    missed = outcome(short, covered=(False, *[True] * 7))
    # The phase shares the eccentricity's verdict and is not counted twice.
    crying = outcome(none, alarms=alarmed("eccentricity", "eccentricity_phase"))
    silent = outcome(none)
    several = [found, missed, crying, silent]
    assert detection([found, missed]) == 0.5
    assert false_alarms(several) == 2 / (6 + 6 + 7 + 7)
    assert recordings_alarmed(several) == 0.5
    np.testing.assert_array_equal(coverage(several), [0.75] + [1.0] * 7)


@pytest.mark.parametrize("count", [8, 20, 300])
def test_chance_is_the_binomial_one(count: int) -> None:
    def at_most(held: int) -> float:
        return sum(math.comb(count, k) * 0.95**k * 0.05 ** (count - k) for k in range(held + 1))

    least = round(count * by_chance(count))
    assert at_most(least - 1) < 1e-3 <= at_most(least)


def test_processes_find_what_diagnose_finds() -> None:
    plan = {seed: [Case(IDEAL, random_faults(seed), seed, (), turns=0)] for seed in (1, 2)}
    for seed, outcomes in measured(plan, "test").items():
        here = diagnosed(plan[seed][0])
        assert replace(outcomes[0], seconds=0.0) == replace(here, seconds=0.0)


def test_an_error_names_its_case() -> None:
    with pytest.raises(ValueError, match="nonsense") as caught:
        diagnosed(Case(IDEAL, Faults(), 7, ("nonsense",)))
    assert any("seed=7" in note for note in caught.value.__notes__)


SMALL_AXES = (
    Axis(
        "noise",
        "Noise",
        "noise",
        lambda value: f"{value:g}",
        lambda value: replace(BASE, noise=value),
        (Curve(DEFAULT, None, (0.0, 0.05)), Curve("more", ("load",), (0.0,))),
    ),
)


def made_up(axes: Sequence[Axis]) -> dict[limits.Key, list[Outcome]]:
    others = [*RECORDED.values(), *FOREIGN.values()]
    return {key: [outcome(case) for case in of_key] for key, of_key in limits.plan(axes, others, 1.0).items()}


def test_the_map_names_the_settings_that_are_wrong_without_saying_so() -> None:
    outcomes = made_up(SMALL_AXES)
    tables = {"Recorded": RECORDED, "Plant": FOREIGN}
    assert "none of 13." in "\n".join(limits.report(SMALL_AXES, tables, outcomes, "limits"))
    gain = NAMES.index("gain")
    missed: dict[str, Any] = {"covered": tuple(i != gain for i in range(8)), "error": 7.25}
    for name, explained in (("compliant shaft, mild", False), ("lagging current sensors, mild", True)):
        key = FOREIGN[name], "random"
        outcomes[key] = [replace(one, explained=explained, **missed) for one in outcomes[key]]
    page = "\n".join(limits.report(SMALL_AXES, tables, outcomes, "limits"))
    assert "1 of 13." in page
    assert (
        "- plant: lagging current sensors, mild: gain held by 0 %, 100 % explained, median error 7.25 %"
        in page
    )
    assert "- plant: compliant shaft" not in page
    assert "| compliant shaft, mild | 7.25 / 7.25 | 88 % | 0 % (gain) | 0 % |" in page


def test_the_base_setting_is_diagnosed_once_for_all_axes() -> None:
    plan = limits.plan(AXES, [*RECORDED.values(), *FOREIGN.values()], 0.0)
    settings = {setting for setting, _ in plan}
    through_base = [setting for axis in AXES for _, _, setting in axis.points() if setting == Setting(BASE)]
    assert len(through_base) == 7  # all but temperature, which is drawn there and set on its axis
    # 46 points on the axes, six of them the base setting again; two more channels, eight foreign plants.
    assert len(settings) == 46 - 6 + 2 + 8
    assert all(len(cases) == 1 for (_, kind), cases in plan.items() if kind != "small")


def test_figures_are_drawn_for_axes_of_one_and_two_curves() -> None:
    outcomes = made_up(SMALL_AXES)
    one = replace(SMALL_AXES[0], curves=SMALL_AXES[0].curves[:1])
    for axis in (one, *SMALL_AXES):
        assert draw(axis, outcomes).startswith(b"<?xml")


def test_figures_are_those_of_the_outcomes() -> None:
    outcomes = made_up(())
    key = Setting(BASE), "random"
    outcomes[key] = [replace(one, error=float(i)) for i, one in enumerate(outcomes[key])]
    figures = Figures.of(Setting(BASE), outcomes)
    last = len(outcomes[key]) - 1
    assert figures.median == last / 2
    assert figures.most == pytest.approx(0.95 * last)
    assert figures.detection == figures.false_alarms == 0
    assert figures.mean_coverage == figures.least_coverage == 1


def test_the_first_table_says_no_where_too_little_was_reached() -> None:
    without = {key: [outcome(case) for case in cases] for key, cases in exact.plan(0.1).items()}
    rig = {key: [outcome(case) for case in cases] for key, cases in base.plan(0.1).items()}
    rows = asked_and_reached(without, rig).splitlines()
    # Intervals that always hold the truth are not 92 to 98 %.
    assert [row.rsplit("|")[-2].strip() for row in rows[2:]] == ["yes"] * 5 + ["no"] * 2 + ["yes", "–"]
    worst = without[exact.RECORDINGS]
    without[exact.RECORDINGS] = [replace(worst[0], error=2.5), *worst[1:]]
    healthy = base.MAIN, "healthy", 0.0
    rig[healthy] = [replace(one, alarms=alarmed("backlash")) for one in rig[healthy]]
    table = asked_and_reached(without, rig)
    assert "9 of 10, the worst 2.50 % | no |" in table
    assert "≤ 0.5 % | 14.29 % | no |" in table
