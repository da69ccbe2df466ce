"""`emaphm doctor`: installed versions, extras and folders."""

import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

from emaphm import environment
from emaphm.environment import PURPOSES

PYPROJECT = Path(__file__).parents[1] / "pyproject.toml"
NOT_FOR_USERS = {"all", "dev", "docs"}


def test_each_extra_has_a_purpose() -> None:
    extras = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    assert set(PURPOSES) == set(extras) - NOT_FOR_USERS


def test_versions_are_those_of_the_installed_packages() -> None:
    answer = environment.environment().to_dict()
    assert answer["packages"]["numpy"] == version("numpy")
    assert all(answer["extras"][name]["packages"] for name in PURPOSES if answer["extras"][name]["installed"])


def test_a_missing_extra_has_its_install_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "requires", lambda _: ["nothing-of-this-name>=1; extra == 'files'"])
    answer = environment.environment()
    assert "pip install 'emaphm[files]'" in str(answer)
    assert answer.to_dict()["extras"]["files"]["missing"] == ["nothing-of-this-name"]


def test_a_folder_without_write_permission_has_a_remark(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("EMAPHM_CACHE_DIR", str(tmp_path / "kernels"))
    monkeypatch.setattr("os.access", lambda *_: False)
    from emaphm.simulation.engine.kernel_cache import kernel_folder

    kernel_folder.cache_clear()
    try:
        assert "EMAPHM_CACHE_DIR" in str(environment.environment())
    finally:
        kernel_folder.cache_clear()
