"""Rigs in plans: recordings, random draws, the resulting trials, and diagnoses."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from emaphm.actuator import NAMES, Actuator, Chirp, Faults
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.actuator.unit.tolerances import Tolerances
from emaphm.diagnosis import diagnose
from emaphm.errors import StudyError
from emaphm.simulated_recording import simulate
from emaphm.study import Plan, run_study
from emaphm.study.cases import SINGLE, heavy_faults, random_faults, small_fault
from emaphm.study.record import actuator_on, load_at, recorded
from emaphm.study.rig import Manoeuvre, Rig, VaryingLoad
from emaphm.study.trials import trials_of

THESIS = Actuator.thesis()
BASE = Rig(label="base")

TEXT = """\
name = "rigs"
runs = 1

[manoeuvre]
duration = 0.1
sample_rate = 2000

[cases]
worn = { friction = 0.3 }

[[methods]]
method = "hybrid"
turns = 0

[[methods]]
method = "da"
population = 4
iterations = 3

[[rigs]]
label = "bench"

[[rigs]]
label = "exact"
channels = ["current_A"]
noise = 0.0
adc_bits = "exact"
load = [0, 0]
heat = [0, 0]

[[groups]]
label = "drawn"
methods = ["hybrid"]
random = 2
heavy = 1
healthy = 1
small = [{ size = 0.05, count = 1 }]

[[groups]]
label = "named"
rigs = ["exact"]
cases = ["worn"]
runs = 3

[[sections]]
title = "Recorded"
label = "recorded"
rows = [{ text = "all", rig = "bench", method = "hybrid" }]
"""


def plan(*changes: tuple[str, str], end: str = "") -> Plan:
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return Plan.from_toml_text(text + end)


# Recordings of a rig


def test_the_same_seed_has_the_same_load_on_every_rig() -> None:
    rigs = (BASE, Rig(label="cold", heat=(0.0, 0.0)), Rig(label="heavy", inertia=(0.1, 0.1)))
    offset = [lumped_parameters(actuator_on(rig, THESIS, 5), ("offset",))["offset"] for rig in rigs]
    assert offset[0] == offset[1] == offset[2] != 0
    drawn = [lumped_parameters(actuator_on(BASE, THESIS, seed), ("offset",))["offset"] for seed in range(50)]
    # Uniform within ±0.2: fifty that span less than 0.3 have probability 1e-5.
    assert 0.3 < np.ptp(drawn) <= 0.4


def test_parameters_of_a_rig_deviate_by_the_stated_amounts() -> None:
    rig = Rig(label="off", load=(0.1, 0.1), heat=(40.0, 40.0), supply=(-0.1, -0.1), inertia=(0.05, 0.05))
    names = ("offset", "resistance", "torque_constant", "supply", "inertia")
    nominal, drawn = lumped_parameters(THESIS, names), lumped_parameters(actuator_on(rig, THESIS, 0), names)
    # Copper gains 0.393 %/K, NdFeB loses 0.11 %/K.
    factors = {"resistance": 1.1572, "torque_constant": 0.956, "supply": 0.9, "inertia": 1.05}
    assert drawn["offset"] == pytest.approx(0.1)
    for name, factor in factors.items():
        assert drawn[name] == pytest.approx(factor * nominal[name])


def test_units_are_drawn_within_tolerances_whether_or_not_these_are_stated() -> None:
    within = Tolerances(torque_constant=0.1, viscous=1.0)
    silent = Rig(label="exact", heat=(0.0, 0.0), tolerances=within)
    stated = Rig(label="stated", heat=(0.0, 0.0), tolerances=within, stated=True)
    names = ("torque_constant", "viscous", "inertia")
    nominal = lumped_parameters(THESIS, names)
    units = [lumped_parameters(actuator_on(silent, THESIS, seed), names) for seed in range(200)]
    factors = {name: np.array([unit[name] / nominal[name] for unit in units]) for name in names}
    assert np.all(factors["inertia"] == 1.0)
    for name, tolerance in (("torque_constant", 0.1), ("viscous", 1.0)):
        # Of 200 units, 182 to 198 are within it, except in one study of a thousand (binomial, 95.4 %).
        assert 182 <= np.sum(np.abs(np.log(factors[name])) <= np.log1p(tolerance)) <= 198
    assert actuator_on(stated, THESIS, 7) == actuator_on(silent, THESIS, 7)
    assert "a unit within tolerances that are not stated" in silent.facts


def test_a_rig_records_the_stated_channels() -> None:
    channels = ("current_A", "voltage_V", "position_rad", "speed_rad_s")
    rig = Rig(label="coarse", channels=channels, sample_rate=1e3, duration=0.1, noise=0.0, adc_bits=8)
    recording = recorded(rig, THESIS, Manoeuvre(), Faults(), 0)
    assert recording.names == ("time_s", "command_rad", *channels)
    assert recording.samples == 100
    step = 2 * 45.0 / 2**8  # plus and minus twice the current limit, over 256 codes
    codes = recording["current_A"] / step
    np.testing.assert_allclose(codes, np.round(codes), atol=1e-9)
    assert recorded(BASE, THESIS, Manoeuvre(duration=0.05), Faults(), 0).samples == 250


def test_the_load_of_a_rig_varies_as_stated() -> None:
    load = VaryingLoad(swing=0.1, frequency=2.0, drift=0.5, step=0.02, hinge=10.0)
    time = np.array([0.0, 0.125, 0.25, 0.375])
    np.testing.assert_allclose(
        load_at(load, time, 0.5), [0.0, 0.1 + 0.0625, 0.125 + 0.02, -0.1 + 0.1875 + 0.02]
    )
    rising, brief = VaryingLoad(step=0.1, rise=0.25), VaryingLoad(step=0.1, lasts=0.2)
    np.testing.assert_allclose(load_at(rising, time, 0.5), [0.0, 0.0, 0.05, 0.1])
    np.testing.assert_allclose(load_at(brief, time + 0.1, 0.5), [0.0, 0.0, 0.1, 0.0])
    options: dict[str, Any] = {"label": "varying", "channels": ("current_A", "position_rad"), "noise": 0.0}
    exact = options | {"adc_bits": None, "load": (0.0, 0.0), "heat": (0.0, 0.0)}
    recording = recorded(Rig(**exact, varying_load=load), THESIS, Manoeuvre(duration=0.1), Faults(), 0)
    stiff = with_lumped_parameters(THESIS, {"hinge": 10.0})
    expected = simulate(stiff, Chirp(duration=0.1), duration=0.1, load=lambda t: load_at(load, t, 0.1))
    np.testing.assert_array_equal(recording["current_A"], expected["current_A"])


# Random draws


@pytest.mark.parametrize("kind", SINGLE)
def test_small_faults_are_single_and_of_the_stated_size(kind: str) -> None:
    drawn = [small_fault(kind, 0.05, seed) for seed in range(30)]
    for faults in drawn:
        deviations = {n: abs(v) for n, v in zip(NAMES, faults.vector - Faults().vector, strict=True) if v}
        deviations.pop("eccentricity_phase", None)
        assert len(deviations) == 1
        assert next(iter(deviations)).startswith(kind)
        assert next(iter(deviations.values())) == pytest.approx(0.05)
    # All phases, both signs, many directions; other faults have one form.
    forms = {"friction": 1, "backlash": 1, "short": 3, "eccentricity": 30, "gain": 2}
    assert len(set(drawn)) == forms[kind]


def test_drawn_vectors_are_within_their_bounds() -> None:
    random, heavy = (
        np.array([draw(seed).vector for seed in range(300)]) for draw in (random_faults, heavy_faults)
    )
    # The largest of 900 is below 99 % of the range with probability 1e-4.
    assert 0.693 < random[:, 2:5].max() <= 0.7
    assert 0.5 <= heavy[:, 2:5].min() < 0.5035
    assert 0.8465 < heavy[:, 2:5].max() <= 0.85
    assert np.array_equal(random[:, [0, 1, 5, 6, 7]], heavy[:, [0, 1, 5, 6, 7]])
    # Literal values, so that pages stay comparable: seed 3 must always draw them.
    assert random_faults(3).friction == pytest.approx(0.08564916714362436, abs=1e-16)


# Trials of a plan


def test_groups_run_their_cases_on_their_rigs_by_their_methods() -> None:
    study_plan = plan()
    drawn = [trial for trial in trials_of(study_plan) if trial.group == "drawn"]
    named = [trial for trial in trials_of(study_plan) if trial.group == "named"]
    assert len(drawn) == (2 + 1 + 1 + 5) * 2 * 1
    assert len(named) == 3 * 1 * 2
    assert len(trials_of(study_plan)) == study_plan.total == 24
    assert [trial.index for trial in trials_of(study_plan)] == list(range(24))
    assert {(trial.rig.label, trial.contestant.label) for trial in drawn if trial.rig} == {
        ("bench", "hybrid"),
        ("exact", "hybrid"),
    }
    assert {trial.seed for trial in named} == {0, 1, 2}
    for trial in drawn:
        assert trial.rig is not None
        assert trial.noise_A == trial.rig.noise
        if trial.case_kind == "random":
            assert trial.truth == tuple(random_faults(trial.seed).vector)
            assert trial.case == f"random {trial.seed}"
    assert [trial.rank for trial in trials_of(study_plan)] == sorted(
        trial.rank for trial in trials_of(study_plan)
    )


def test_the_seed_of_the_plan_changes_all_draws() -> None:
    seeds = {trial.case: trial.seed for trial in trials_of(plan(("runs = 1\n\n", "runs = 1\nseed = 10\n\n")))}
    assert (seeds["random 0"], seeds["random 1"], seeds["heavy 0"]) == (10, 11, 10)


def test_a_share_has_at_least_one_trial_of_each_kind() -> None:
    study_plan = plan()
    assert {(t.case_kind, t.rig, t.contestant.label) for t in trials_of(study_plan, 1e-3)} == {
        (t.case_kind, t.rig, t.contestant.label) for t in trials_of(study_plan)
    }
    assert trials_of(study_plan, 1.0) == trials_of(study_plan)


def test_without_groups_all_cases_run_on_all_rigs() -> None:
    study_plan = plan((TEXT[TEXT.index("[[groups]]") : TEXT.index("[[sections]]")], ""))
    assert [(t.rig.label, t.contestant.label) for t in trials_of(study_plan) if t.rig] == [
        ("bench", "hybrid"),
        ("bench", "da"),
        ("exact", "hybrid"),
        ("exact", "da"),
    ]
    assert len({trial.seed for trial in trials_of(study_plan)}) == 1


@pytest.mark.parametrize("name", ["accuracy", "limits"])
def test_the_built_in_plans_have_all_rows_of_their_pages(name: str) -> None:
    study_plan = Plan.load(name)
    present = {(t.rig.label, t.contestant.label) for t in trials_of(study_plan) if t.rig}
    rows = {(row.rig, row.method) for section in study_plan.sections for row in section.rows}
    assert rows == present
    assert study_plan.page == name


# Diagnoses


def test_a_diagnosis_on_a_rig_equals_that_by_a_user(tmp_path: Path) -> None:
    drawn = "random = 2\nheavy = 1\nhealthy = 1\nsmall = [{ size = 0.05, count = 1 }]"
    study_plan = plan((drawn, "random = 1"))
    results = run_study(study_plan, tmp_path / "study", workers=1).results
    for row in results.filter(group="drawn").iter_rows(named=True):
        rig = next(rig for rig in study_plan.rigs if rig.label == row["rig"])
        recording = recorded(rig, THESIS, study_plan.manoeuvre, Faults(*row["truth"]), row["seed"])
        diagnosis = diagnose(recording, THESIS, max_corrections=0, seed=row["seed"])
        assert row["found"] == diagnosis.faults.vector.tolist()
        assert list(zip(row["lower95"], row["upper95"], strict=True)) == [
            diagnosis.interval[n] for n in NAMES
        ]
        assert row["standard_error"] == [diagnosis.components[n].standard_error for n in NAMES]
        assert row["verdict"] == [diagnosis.components[n].verdict for n in NAMES]
        assert (row["explained"], row["moves"]) == (diagnosis.explained, diagnosis.moves)
        assert (row["evaluations"], row["reference_runs"]) == (
            diagnosis.evaluations,
            diagnosis.reference_runs,
        )
        # The time of the trial includes the recording and the start of the diagnosis.
        assert 0 < row["seconds"] < row["wall_seconds"]
        assert row["cpu_seconds"] > 0
    searched = results.filter(method="da")
    assert searched["verdict"].null_count() == searched["explained"].null_count() == searched.height == 3
    assert all(len(curve) == 3 for curve in searched["curve_fitness"])


# Refused plans

REFUSED: dict[str, tuple[tuple[str, str], tuple[str, ...]]] = {
    "nothing to state": (
        ('label = "exact"', 'label = "exact"\nstated = true'),
        ("'tolerances'", "leave out 'stated'"),
    ),
    "key of a rig": (
        ('label = "bench"', 'label = "bench"\nnoize = 1'),
        ("'rigs.0.noize'", "did you mean 'noise'?"),
    ),
    "channel": (('["current_A"]', '["current_a"]'), ("'rigs.1.channels'", "unknown channel", "current_A")),
    "no current": (('["current_A"]', '["voltage_V"]'), ("'rigs.1.channels'", "'current_A' is missing")),
    "bits": (
        ('adc_bits = "exact"', "adc_bits = 40"),
        ("'rigs.1.adc_bits'", "40 bits is not known; give 4 to 24"),
    ),
    "rate": (('adc_bits = "exact"', "sample_rate = 1e9"), ("'rigs.1.sample_rate'", "100000")),
    "duration": (('adc_bits = "exact"', "duration = 0"), ("'rigs.1.duration'", "greater than 0")),
    "range": (("load = [0, 0]", "load = [1, 0]"), ("'rigs.1.load'", "swap the two")),
    "heat": (("heat = [0, 0]", "heat = [0, 1e9]"), ("'rigs.1.heat.1'", "200")),
    "supply": (("heat = [0, 0]", "supply = [-1, 0]"), ("'rigs.1.supply.0'", "greater than -1")),
    "noise": (("noise = 0.0", "noise = -1"), ("'rigs.1.noise'", "-1")),
    "foreign": (
        ("noise = 0.0", "foreign = { shaft = { stiffness = 0, damping = 1 } }"),
        ("'rigs.1.foreign.shaft.stiffness'", "greater than 0"),
    ),
    "foreign controller": (
        ("noise = 0.0", "controller_noise = 1\nforeign = { sensor_lag = 1e-5 }"),
        ("'rigs.1'", "leave out 'controller_noise'"),
    ),
    "foreign load": (
        ("noise = 0.0", "varying_load = { drift = 0.1 }\nforeign = { sensor_lag = 1e-5 }"),
        ("'rigs.1'", "leave out 'varying_load'"),
    ),
    "one rig twice": (('label = "exact"', 'label = "bench"'), ("two rigs are called 'bench'",)),
    "one group twice": (('label = "named"', 'label = "drawn"'), ("two groups are called 'drawn'",)),
    "rig of a group": (('rigs = ["exact"]', 'rigs = ["exakt"]'), ("group 'named'", "did you mean 'exact'?")),
    "method of a group": (
        ('methods = ["hybrid"]', 'methods = ["hybird"]'),
        ("'drawn'", "did you mean 'hybrid'?"),
    ),
    "case of a group": (('cases = ["worn"]', 'cases = ["torn"]'), ("group 'named'", "did you mean 'worn'?")),
    "case twice": (('cases = ["worn"]', 'cases = ["worn", "worn"]'), ("'groups.1.cases'", "given twice")),
    "empty group": (('cases = ["worn"]\n', ""), ("group 'named' has no cases",)),
    "size": (("size = 0.05", "size = 0.9"), ("'groups.0.small.0.size'", "0.5")),
    "too many": (("random = 2", "random = 1000000"), ("runs are too many",)),
    "row": (
        ('rig = "bench", method', 'rig = "bensh", method'),
        ("section 'Recorded'", "did you mean 'bench'?"),
    ),
    "noises": (("runs = 1\n\n[man", "runs = 1\nnoises_A = [0.1]\n\n[man"), ("'noises_A'", "its 'noise'")),
    "equivalents": (
        ("runs = 1\n\n[man", 'runs = 1\nequivalents = ["active"]\n\n[man'),
        ("'equivalents'", "torque current"),
    ),
    "random and groups": (("[cases]", "[random]\ncount = 1\n[cases]"), ("[random] does not go with",)),
    "both spellings": (("turns = 0", "turns = 0\nmax_corrections = 0"), ("'methods.0'", "are the same")),
    "page": (
        ("runs = 1\n\n[man", 'runs = 1\npage = "acuracy"\n\n[man'),
        ("'page'", "'accuracy', 'limits', 'plants', 'loads', 'data_sheets', 'pmsm' or 'six_step'"),
    ),
}


@pytest.mark.parametrize(("change", "pieces"), REFUSED.values(), ids=REFUSED.keys())
def test_an_invalid_plan_is_refused_in_one_line(change: tuple[str, str], pieces: tuple[str, ...]) -> None:
    with pytest.raises(StudyError) as refusal:
        plan(change)
    message = str(refusal.value)
    assert len(message.splitlines()) == 1
    for piece in pieces:
        assert piece in message


def test_groups_need_rigs() -> None:
    a, b = TEXT.index("[[rigs]]"), TEXT.index("[[groups]]")
    text = TEXT[:a] + TEXT[b:].replace('rigs = ["exact"]\n', "")
    with pytest.raises(StudyError, match=r"\[\[groups\]\] need \[\[rigs\]\]"):
        Plan.from_toml_text(text[: text.index("[[sections]]")])


@pytest.mark.parametrize("key", ["turns", "max_corrections"])
def test_both_spellings_of_the_corrections_are_read(key: str) -> None:
    study_plan = plan(("turns = 0", f"{key} = 3"))
    assert study_plan.methods[0].max_corrections == 3
    values: dict[str, Any] = study_plan.model_dump(mode="json")
    assert values["methods"][0]["max_corrections"] == 3
    assert Plan.model_validate(values) == study_plan
