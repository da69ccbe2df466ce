"""The fingerprint of the code: it changes only with code and libraries on which a result depends."""

from collections.abc import Iterable
from pathlib import Path

import pytest

from emaphm.diagnosis import deciding_code as diagnosis
from emaphm.execution import revision as module
from emaphm.execution.revision import deciding_files, meaning
from emaphm.fleet import task as fleet
from emaphm.study import revision as study
from emaphm.study.revision import DECIDING, NOT_DECIDING, revision
from emaphm.study.spoilt import revision as spoilt
from imports import MODULES, ROOT, home_of, import_statements, reached, tree_of

SOURCE = '''\
"""What it is about."""

STEP = 1e-6
"""A step [s]."""


class Law:
    """A law."""

    gain: float = 2.0
    """Of the law."""

    def apply(self, x):
        """Return it."""
        # a comment
        return self.gain * x
'''


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("What it is about", "Another text"),
        ("A step [s]", "The step [s]"),
        ("Of the law", "Of this law"),
        ('        """Return it."""\n', ""),
        ("# a comment", "# another"),
        ("\n\n\nclass", "\n\nclass"),
        ("self.gain * x", "(self.gain*x)"),
    ],
)
def test_comments_docstrings_and_layout_do_not_change_the_meaning(old: str, new: str) -> None:
    assert old in SOURCE
    assert meaning(SOURCE.replace(old, new)) == meaning(SOURCE)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("1e-6", "2e-6"),
        ("2.0", "2"),
        ("* x", "+ x"),
        ("gain", "factor"),
        ("x)", "x, y)"),
        ("self.gain", '"text"'),
    ],
)
def test_numbers_names_and_operations_change_the_meaning(old: str, new: str) -> None:
    assert old in SOURCE
    assert meaning(SOURCE.replace(old, new)) != meaning(SOURCE)


def test_a_function_with_only_a_docstring_can_be_read() -> None:
    assert meaning('def f():\n    """Do nothing."""') == meaning('def f():\n    """Do it."""')


# Dependencies of a task

HARMLESS = {
    "actuator/toml": "reads and writes descriptions; what is described is a value of the task",
    "blas_threads.py": "how many threads a library has",
    "calibration/text.py": "lays out text",
    "diagnosis/text.py": "lays out text",
    "diagnosis/wording.py": "puts faults in words",
    "errors.py": "messages",
    "execution": "has tasks done and keeps what they find",
    "experiment/excitation.py": "describes tests that are designed; only a constant of a test setup is used",
    "identity_cache.py": "keeps what other files determine from a description",
    "input_files.py": "digests of files",
    "optional_library.py": "says what is not installed",
    "output_files.py": "writes files",
    "plotting": "draws a result when it is asked to",
    "progress.py": "reports progress",
    "recording/io/limits.py": "bounds on what is read of a file, and words of an error",
    "study/plan.py": "values of the task",
    "study/revision.py": "names the code that counts",
    "study/rig.py": "values of the task",
    "study/spoilt/revision.py": "names the code that counts",
    "study/trials.py": "values of the task",
    "text_table.py": "lays out text",
    "threads.py": "the same results, whatever the number of threads",
    "version.py": "the number of the version, which is kept with each result",
}
"""Dependencies of tasks that do not affect their results, each with the reason."""

OF_ONE_TASK = {
    "emaphm.study.task": {
        "experiment/test_setup.py": "a bound on faults, which are values of the task",
        "study/cases.py": "faults of cases, which are values of the task",
    },
    "emaphm.study.spoilt.run": {},
    "emaphm.fleet.task": {"simulated_recording.py": "for the setup that an estimator is trained for"},
}
"""Dependencies that do not affect results of this task, but may affect those of other tasks."""

TASKS = {
    "emaphm.study.task": (study.DECIDING, study.NOT_DECIDING),
    "emaphm.study.spoilt.run": (spoilt.DECIDING, spoilt.NOT_DECIDING),
    "emaphm.fleet.task": (fleet.DECIDING, diagnosis.NOT_DECIDING),
}
"""Modules with a `perform` whose results are stored, with the code that identifies the results."""


def files_reached(task: str) -> set[str]:
    """Return the files on which a task's module depends, without files that only re-export names."""
    paths = (MODULES[name] for name in reached(task))
    return {path.relative_to(ROOT).as_posix() for path in paths if path.name != "__init__.py"}


def deciding(task: str) -> set[str]:
    """Return the files whose fingerprint identifies the results of a task."""
    return {path.relative_to(ROOT).as_posix() for path in deciding_files(ROOT, *TASKS[task])}


def below(file: str, places: Iterable[str]) -> bool:
    return any(file == place or file.startswith(f"{place}/") for place in places)


@pytest.mark.parametrize("task", TASKS)
def test_all_dependencies_of_a_task_identify_its_results_or_are_harmless(task: str) -> None:
    harmless = {*HARMLESS, *OF_ONE_TASK[task]}
    unlisted = files_reached(task) - deciding(task)
    assert {file for file in unlisted if not below(file, harmless)} == set()


def test_all_files_listed_as_harmless_are_dependencies() -> None:
    files = {task: files_reached(task) for task in TASKS}
    all_files = set().union(*files.values())
    assert {place for place in HARMLESS if not any(below(file, [place]) for file in all_files)} == set()
    for name, places in OF_ONE_TASK.items():
        assert set(places) <= files[name]


def test_the_rig_module_does_not_compute_with_arrays() -> None:
    imports = import_statements(tree_of("emaphm.study.rig"), when_called=True)
    assert "numpy" not in {alias.name for statement in imports for alias in statement.names}


def test_a_name_re_exported_by_a_package_leads_to_its_file_of_definition() -> None:
    assert home_of("emaphm.fleet", "DiagnosisSettings") == "emaphm.fleet.settings"
    assert home_of("emaphm.study", "foreign_plant") == "emaphm.study.foreign_plant"
    assert home_of("emaphm.study.rig", "Rig") == "emaphm.study.rig"
    assert {"emaphm.study.foreign_plant", "emaphm.diagnosis.verdict"} <= reached("emaphm.study.task")


def test_a_moved_file_in_the_list_raises_an_error() -> None:
    for names, left_out in ((("actuator",), ("actuator/toml.py",)), (("actuators",), ())):
        with pytest.raises(FileNotFoundError, match=r"no actuator.*; correct the list"):
            deciding_files(ROOT, names, left_out)


def test_versions_of_libraries_change_the_fingerprint(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    computed = module.revision_of.__wrapped__  # a value cached by an earlier call would not be computed
    current = revision()
    assert len(current) == 12
    monkeypatch.setenv("EMAPHM_CACHE_DIR", str(tmp_path))  # nor a value cached by an earlier process
    monkeypatch.setattr(module, "meaning", lambda _: "")  # the fingerprint of the code takes long
    alike = computed(DECIDING, NOT_DECIDING)
    assert computed(DECIDING, NOT_DECIDING) == alike != current
    monkeypatch.setattr(module, "version", lambda name: "0.0" if name == "numpy" else "1.0")
    assert computed(DECIDING, NOT_DECIDING) != alike


def test_the_fingerprint_is_cached_for_the_files_it_was_computed_from(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("EMAPHM_CACHE_DIR", str(tmp_path / "kept"))
    (tmp_path / "law.py").write_text(SOURCE)
    monkeypatch.setattr(module, "ROOT", tmp_path)
    sources: list[str] = []

    def counted(source: str) -> str:
        sources.append(source)
        return meaning(source)

    monkeypatch.setattr(module, "meaning", counted)

    def fingerprint() -> str:
        return module.revision_of.__wrapped__(("law.py",), ())

    first = fingerprint()
    assert (fingerprint(), len(sources)) == (first, 1)
    (tmp_path / "law.py").write_text(SOURCE.replace("a comment", "another"))
    assert (fingerprint(), len(sources)) == (first, 2)  # read again, although the meaning is the same
    (tmp_path / "law.py").write_text(SOURCE.replace("* x", "+ x"))
    changed = fingerprint()
    assert changed != first
    for damaged in ("", "\xff", "0 1"):
        (cache_file,) = (tmp_path / "kept").iterdir()
        cache_file.write_text(damaged, encoding="utf-8")
        assert fingerprint() == changed
    cache_file.unlink()
    cache_file.mkdir()  # no value can be stored
    assert fingerprint() == changed
