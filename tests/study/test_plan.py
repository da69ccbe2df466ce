"""The tasks of a plan and their seeds, and refused plans."""

from pathlib import Path

import pytest

from emaphm.actuator import Actuator, Faults
from emaphm.actuator.toml import write_toml
from emaphm.errors import StudyError
from emaphm.study import BUILT_IN, Plan
from emaphm.study.cases import MOST_RUNS
from emaphm.study.trials import Trial, trials_of

from . import small

ANOTHER_METHOD = '[[methods]]\nmethod = "dragonfly-thesis"\n'


def seeds(plan: Plan) -> dict[tuple[str, int], set[int]]:
    """Return the seeds of each case and run."""
    by_case: dict[tuple[str, int], set[int]] = {}
    for trial in trials_of(plan):
        by_case.setdefault((trial.case, trial.run), set()).add(trial.seed)
    return by_case


def combination(trial: Trial) -> tuple[object, ...]:
    return (
        trial.case,
        trial.contestant.label,
        trial.model,
        trial.fitness,
        trial.equivalent,
        trial.noise_A,
        trial.run,
    )


# Tasks


def test_each_combination_is_run_the_requested_number_of_times() -> None:
    plan = small.plan(
        top='models = ["averaged", "monitor"]\nfitnesses = ["least_squares", "thesis"]\n'
        'equivalents = ["torque", "active", "magnitude"]\nnoises_A = [0, 0.1]'
    )
    trials = trials_of(plan)
    # cases × methods × models × fitnesses × equivalents × noises × runs
    assert len(trials) == 2 * 2 * 2 * 2 * 3 * 2 * 3
    assert len({combination(trial) for trial in trials}) == len(trials)
    assert [trial.index for trial in trials] == list(range(len(trials)))


def test_the_first_runs_of_all_combinations_come_first() -> None:
    assert [trial.run for trial in trials_of(small.plan())] == [0] * 4 + [1] * 4 + [2] * 4


def test_cases_are_fault_vectors_with_unnamed_components_healthy() -> None:
    truths = {trial.case: trial.truth for trial in trials_of(small.plan())}
    assert truths["worn"] == tuple(Faults(friction=0.3).vector)
    assert truths["loose"] == tuple(Faults(backlash=0.4, gain=0.7).vector)


def test_only_methods_share_the_seed_of_a_case_and_run() -> None:
    by_case = seeds(small.plan(("runs = 3", "runs = 50"), end="[random]\ncount = 20"))
    assert len(by_case) == 50 * 22
    assert all(len(of_one) == 1 for of_one in by_case.values())
    assert len(set[int]().union(*by_case.values())) == len(by_case)


@pytest.mark.parametrize(
    "larger",
    [
        small.plan(end=ANOTHER_METHOD),
        small.plan(("[cases]", "[cases]\nfirst = { gain = 1.0 }")),
        small.plan(("runs = 3", "runs = 7")),
        small.plan(end="[random]\ncount = 12"),
        small.plan(top="noises_A = [0, 0.2]"),
    ],
    ids=["method", "case", "runs", "random", "noise"],
)
def test_a_larger_plan_keeps_the_seeds_of_a_smaller_plan(larger: Plan) -> None:
    assert seeds(small.plan()).items() <= seeds(larger).items()
    assert len(trials_of(larger)) > len(trials_of(small.plan()))


def test_another_seed_of_the_plan_changes_all_seeds() -> None:
    first, second = (
        {trial.seed for trial in trials_of(plan)} for plan in (small.plan(), small.plan(top="seed = 1"))
    )
    assert not first & second


# Random cases


def test_random_cases_are_within_their_bounds() -> None:
    plan = small.plan(end="[random]\ncount = 200\nlargest_short = 0.4")
    drawn = [values for name, values in plan.all_cases.items() if name.startswith("random")]
    assert len(drawn) == 200
    shorts = [case[name] for case in drawn for name in ("short_a", "short_b", "short_c")]
    unshorted = [value for case in drawn for name, value in case.items() if not name.startswith("short")]
    # The largest of n uniform numbers is below 95 % of the bound with probability 0.95^n < 1e-13.
    assert 0.38 < max(shorts) <= 0.4
    assert 0.95 < max(unshorted) <= 1
    assert min(shorts + unshorted) >= 0


def test_more_random_cases_begin_with_the_same_cases() -> None:
    few = small.plan(end="[random]\ncount = 9\nseed = 4").all_cases
    many = small.plan(end="[random]\ncount = 120\nseed = 4").all_cases
    assert few.items() <= many.items()
    assert few != small.plan(end="[random]\ncount = 9\nseed = 5").all_cases


# Labels, actuators, built-in plans


def test_a_method_is_named_by_its_label_or_by_its_given_name() -> None:
    methods = small.plan(end=ANOTHER_METHOD + '[[methods]]\nmethod = "da"\n').methods
    assert [contestant.label for contestant in methods] == ["few", "more", "dragonfly-thesis", "da"]
    listed = Plan.from_toml_text(
        'methods = ["da", "hybrid"]\n' + small.TEXT[: small.TEXT.index("[[methods]]")]
    )
    assert [contestant.label for contestant in listed.methods] == ["da", "hybrid"]


def test_the_actuator_file_is_relative_to_the_plan(tmp_path: Path) -> None:
    heavy = Actuator.thesis().model_copy(update={"name": "heavy"})
    (tmp_path / "heavy.toml").write_text(write_toml(heavy), encoding="utf-8")
    (tmp_path / "plan.toml").write_text(small.with_(top='actuator = "heavy.toml"'), encoding="utf-8")
    assert Plan.load(tmp_path / "plan.toml").actuator == heavy


def test_a_plan_is_read_back_from_its_json() -> None:
    plan = small.plan(top="noises_A = [0, 0.1]", end="[random]\ncount = 2")
    reread = Plan.model_validate_json(plan.model_dump_json())
    assert reread == plan
    assert trials_of(reread) == trials_of(plan)


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_plans_can_be_loaded(name: str) -> None:
    plan = Plan.load(name)
    assert plan.name == name
    assert plan.description
    assert trials_of(plan)


def test_the_thesis_plan_is_that_of_the_thesis() -> None:
    plan = Plan.load("thesis")
    assert sorted(map(len, plan.cases.values())) == [1] * 10 + [8]
    assert plan.runs == 10
    assert plan.actuator == Actuator.thesis()
    # Thesis 6.7: five metaheuristics, 50 agents × 200 iterations.
    swarms = {"genetic", "particle-swarm", "differential-evolution", "grey-wolf", "dragonfly"}
    full = set()
    for contestant in plan.methods:
        method = contestant.chosen()
        if method.least_squares or method.optimizer is None:
            continue
        optimizer = method.optimizer([0.0] * 8, [1.0] * 8)
        if (optimizer.population, optimizer.iterations) == (50, 200):
            full.add(method.name)
    assert full >= swarms


# Refused plans

WHOLE = small.TEXT
HYBRID = '[[methods]]\nmethod = "hybrid"\n'
NO_CASES = ("worn = { friction = 0.3 }\nloose = { backlash = 0.4, gain = 0.7 }", "")

REFUSED: dict[str, tuple[str, tuple[str, ...]]] = {
    # names, refused with the nearest name
    "method": (small.with_(('"da"', '"dargonfly"')), ("'dargonfly'", "did you mean 'dragonfly'?")),
    "method, abbreviated": (small.with_(('"da"', '"dda"')), ("'dda'", "did you mean 'da'?")),
    "method, strange": (small.with_(('"da"', '"xyzzy"')), ("'xyzzy'", "known: ", "hybrid")),
    "fault": (small.with_(("friction", "frictoin")), ("case 'worn'", "did you mean 'friction'?")),
    "model": (small.with_(top='models = ["avreaged"]'), ("'avreaged'", "did you mean 'averaged'?")),
    "fitness": (small.with_(top='fitnesses = ["thsis"]'), ("'thsis'", "did you mean 'thesis'?")),
    "equivalent": (small.with_(top='equivalents = ["torqe"]'), ("'torqe'", "did you mean 'torque'?")),
    "setting": (
        small.with_(("population = 8", "populatoin = 8")),
        ("'methods.1'", "'populatoin'", "did you mean 'population'?"),
    ),
    "setting of hybrid": (
        small.with_(end=HYBRID + "population = 8"),
        ("'methods.2'", "'hybrid' has no setting 'population'", "leave it out"),
    ),
    # keys, at each level
    "key": (small.with_(top="rnus = 3"), ("'rnus'", "did you mean 'runs'?")),
    "key of manoeuvre": (
        small.with_(("duration", "duratoin")),
        ("'manoeuvre.duratoin'", "did you mean 'duration'?"),
    ),
    "manoeuvre too fast for its rows": (
        small.with_(("duration", "stop_hz = 2600\nduration")),
        ("'manoeuvre'", "'stop_hz' 2600", "half of 'sample_rate'"),
    ),
    "key of random": (
        small.with_(end="[random]\ncount = 2\nsede = 1"),
        ("'random.sede'", "did you mean 'seed'?"),
    ),
    "missing name": (small.with_(('name = "small"\n', "")), ("'name' is missing", "add it")),
    "missing runs": (small.with_(("runs = 3\n", "")), ("'runs' is missing", "add it")),
    "missing method": (
        small.with_(('method = "da"\n', "")),
        ("'methods.1.method' is missing", "add it"),
    ),
    # kinds of values and their limits
    "runs, text": (small.with_(("runs = 3", 'runs = "three"')), ("'runs'", "integer", "'three'")),
    "runs, broken": (small.with_(("runs = 3", "runs = 1.5")), ("'runs'", "integer", "1.5")),
    "runs, negative": (small.with_(("runs = 3", "runs = -1")), ("'runs'", "1", "-1")),
    "runs, too many": (
        small.with_(("runs = 3", f"runs = {MOST_RUNS}")),
        (f"{4 * MOST_RUNS} runs are too many", "reduce the plan"),
    ),
    "seed": (small.with_(top="seed = -1"), ("'seed'", "-1")),
    "models, one": (small.with_(top='models = "averaged"'), ("'models'", "'averaged'")),
    "noise, one": (small.with_(top="noises_A = 0.1"), ("'noises_A'", "0.1")),
    "noise, negative": (small.with_(top="noises_A = [0, -0.1]"), ("'noises_A.1'", "-0.1")),
    "noise, none": (small.with_(top="noises_A = [nan]"), ("'noises_A.0'", "finite")),
    "case, number": (small.with_(("{ friction = 0.3 }", "0.3")), ("'cases.worn'", "0.3")),
    "fault, text": (small.with_(("0.3", '"much"')), ("'cases.worn.friction'", "number", "'much'")),
    "fault, too large": (small.with_(("0.3", "1.3")), ("case 'worn'", "friction=1.3", "outside [-1, 1]")),
    "setting, text": (
        small.with_(("population = 8", 'population = "eight"')),
        ("'methods.1'", "whole number", "'eight'"),
    ),
    "setting, too small": (
        small.with_(("population = 8", "population = 1")),
        ("'methods.1'", "population must be at least 2, got 1"),
    ),
    "turns": (small.with_(end=HYBRID + "turns = 99"), ("'methods.2.max_corrections'", "20", "99")),
    "method, number": (small.with_(('"da"', "3")), ("'methods.1.method'", "string", "3")),
    "label, empty": (small.with_(('"more"', '""')), ("'methods.1.label'", "at least 1")),
    "duration": (
        small.with_(("duration = 0.05", "duration = 0")),
        ("'manoeuvre.duration'", "greater than 0"),
    ),
    "shorts": (
        small.with_(end="[random]\ncount = 1\nlargest_short = 1.5"),
        ("'random.largest_short'", "1.5"),
    ),
    "actuator, number": (small.with_(top="actuator = 5"), ("'actuator'", "5")),
    "actuator, unknown": (
        small.with_(top='actuator = "absent.toml"'),
        ("'actuator'", "absent.toml", "no such actuator file"),
    ),
    # nothing requested
    "no runs": (small.with_(("runs = 3", "runs = 0")), ("'runs'", "1", "0")),
    "no cases": (small.with_(NO_CASES), ("no cases", "nothing to run", "add [cases] or [random]")),
    "no section of cases": (
        small.with_(NO_CASES, ("[cases]", "")),
        ("no cases", "nothing to run", "add [cases] or [random]"),
    ),
    "no random cases": (small.with_(NO_CASES, end="[random]\ncount = 0"), ("'random.count'", "1", "0")),
    "no methods": (
        f"methods = []\n{WHOLE[: WHOLE.index('[[methods]]')]}",
        ("'methods' is empty", "name at least one"),
    ),
    "no section of methods": (WHOLE[: WHOLE.index("[[methods]]")], ("'methods' is missing", "add it")),
    **{
        f"no {key}": (small.with_(top=f"{key} = []"), (f"'{key}' is empty", "name at least one"))
        for key in ("models", "fitnesses", "equivalents", "noises_A")
    },
    # contradictory settings
    "one label": (small.with_(('"more"', '"few"')), ("two methods are called 'few'", "a different label")),
    "one model": (
        small.with_(top='models = ["averaged", "averaged"]'),
        ("'models' contains a value twice", "give each value once"),
    ),
    "one case": (
        small.with_(("worn", '"random 1"'), end="[random]\ncount = 2"),
        ("case 'random 1'", "[random]", "rename it"),
    ),
    "hybrid by another fitness": (
        small.with_(top='fitnesses = ["least_squares", "thesis"]', end=HYBRID),
        ("'hybrid'", "least_squares", "fitness 'thesis'", "choose an optimiser alone"),
    ),
    "hybrid on a switching model": (
        small.with_(top='models = ["monitor"]', end=HYBRID),
        ("'hybrid'", "derivatives", "monitor model", "leave out one"),
    ),
    "refinement on a switching model": (
        small.with_(('"da"', '"da+lsq"'), top='models = ["monitor"]'),
        ("'da+lsq'", "derivatives", "monitor model", "leave out one"),
    ),
    # TOML
    "syntax": (small.with_(("runs = 3", "runs = ")), ("not valid TOML", "line 3", "correct the syntax")),
    "a key twice": (small.with_(top="runs = 2"), ("not valid TOML", "line 3", "correct the syntax")),
}


@pytest.mark.parametrize(("text", "pieces"), REFUSED.values(), ids=REFUSED.keys())
def test_an_invalid_plan_is_refused_in_one_line(tmp_path: Path, text: str, pieces: tuple[str, ...]) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(StudyError) as refusal:
        Plan.load(file)
    message = str(refusal.value)
    assert message.startswith(f"{file}: ")
    assert len(message.splitlines()) == 1
    assert "description" not in message  # a key of the plan that no entry above concerns
    for piece in pieces:
        assert piece in message


@pytest.mark.parametrize(
    ("name", "pieces"),
    [
        ("thesi", ("'thesi'", "did you mean 'thesis'?", "path of its TOML")),
        ("nothing like it", ("known: accuracy, data_sheets, forms, hybrids", "path of its TOML")),
        ("n" * 300, ("known: accuracy, data_sheets, forms, hybrids",)),
        ("absent.toml", ("absent.toml", "no such plan file", "give the path")),
        (".", (".: is a folder", "give a file in it")),
        ("latin.toml", ("latin.toml", "cannot be read as a TOML text file", "give one in UTF-8")),
    ],
)
def test_a_missing_plan_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, pieces: tuple[str, ...]
) -> None:
    (tmp_path / "latin.toml").write_bytes('name = "Größe"'.encode("latin-1"))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(StudyError) as refusal:
        Plan.load(name)
    assert len(str(refusal.value).splitlines()) == 1
    for piece in pieces:
        assert piece in str(refusal.value)
