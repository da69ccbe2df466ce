"""The fingerprint of the code: it changes with what a result depends on, and with nothing else."""

from pathlib import Path

import pytest

import emaphm
from emaphm.execution import revision as module
from emaphm.execution.revision import deciding_files, meaning
from emaphm.study.revision import DECIDING, NOT_DECIDING, revision

ROOT = Path(emaphm.__file__).parent

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
def test_words_and_layout_do_not_count(old: str, new: str) -> None:
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
def test_numbers_names_and_operations_count(old: str, new: str) -> None:
    assert old in SOURCE
    assert meaning(SOURCE.replace(old, new)) != meaning(SOURCE)


def test_a_function_of_a_docstring_alone_is_read() -> None:
    assert meaning('def f():\n    """Do nothing."""') == meaning('def f():\n    """Do it."""')


def test_the_files_are_those_that_a_result_depends_on() -> None:
    names = {path.relative_to(ROOT).as_posix() for path in deciding_files(ROOT, DECIDING, NOT_DECIDING)}
    assert names >= {
        "simulation/models/reference.py",
        "optimizers/dragonfly.py",
        "estimation/search.py",
        "diagnosis/verdict.py",
        "recording/acquisition.py",
        "study/foreign_plant.py",
        "study/record.py",
        "study/task.py",
    }
    left_out = (
        "plotting/",
        "report/",
        "cli/",
        "recording/io/",
        "study/analysis/",
        "execution/",
        "actuator/toml/",
    )
    assert not [name for name in names if name.startswith(left_out)]


def test_a_file_that_was_moved_is_not_passed_over() -> None:
    for names, left_out in ((("actuator",), ("actuator/toml.py",)), (("actuators",), ())):
        with pytest.raises(FileNotFoundError, match=r"no actuator.*; correct the list"):
            deciding_files(ROOT, names, left_out)


def test_libraries_count(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    computed = module.revision_of.__wrapped__  # what is kept of an earlier call would say nothing
    here = revision()
    assert len(here) == 12
    monkeypatch.setenv("EMAPHM_CACHE_DIR", str(tmp_path))  # nor what is kept of an earlier process
    monkeypatch.setattr(module, "meaning", lambda _: "")  # of the code, which takes long
    alike = computed(DECIDING, NOT_DECIDING)
    assert computed(DECIDING, NOT_DECIDING) == alike != here
    monkeypatch.setattr(module, "version", lambda name: "0.0" if name == "numpy" else "1.0")
    assert computed(DECIDING, NOT_DECIDING) != alike


def test_it_is_kept_for_the_files_that_it_is_of(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("EMAPHM_CACHE_DIR", str(tmp_path / "kept"))
    (tmp_path / "law.py").write_text(SOURCE)
    monkeypatch.setattr(emaphm, "__file__", str(tmp_path / "__init__.py"))
    read: list[str] = []

    def counted(source: str) -> str:
        read.append(source)
        return meaning(source)

    monkeypatch.setattr(module, "meaning", counted)

    def found() -> str:
        return module.revision_of.__wrapped__(("law.py",), ())

    first = found()
    assert (found(), len(read)) == (first, 1)
    (tmp_path / "law.py").write_text(SOURCE.replace("a comment", "another"))
    assert (found(), len(read)) == (first, 2)  # of files that mean the same
    (tmp_path / "law.py").write_text(SOURCE.replace("* x", "+ x"))
    other = found()
    assert other != first
    for spoilt in ("", "\xff", "0 1"):
        (kept,) = (tmp_path / "kept").iterdir()
        kept.write_text(spoilt, encoding="utf-8")
        assert found() == other
    kept.unlink()
    kept.mkdir()  # nothing can be kept
    assert found() == other
