"""`emaphm doctor`: what is installed."""

import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

from emaphm import environment
from emaphm.environment import PURPOSES

PYPROJECT = Path(__file__).parents[1] / "pyproject.toml"
NOT_FOR_USERS = {"all", "dev", "docs"}


def test_every_extra_has_its_purpose() -> None:
    extras = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    assert set(PURPOSES) == set(extras) - NOT_FOR_USERS


def test_versions_are_those_installed() -> None:
    found = environment.environment().to_dict()
    assert found["packages"]["numpy"] == version("numpy")
    assert all(found["extras"][name]["packages"] for name in PURPOSES if found["extras"][name]["installed"])


def test_missing_extra_says_how_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "requires", lambda _: ["nothing-of-this-name>=1; extra == 'files'"])
    found = environment.environment()
    assert "pip install 'emaphm[files]'" in str(found)
    assert found.to_dict()["extras"]["files"]["missing"] == ["nothing-of-this-name"]


def test_folder_without_permission_is_remarked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("EMAPHM_CACHE_DIR", str(tmp_path / "kernels"))
    monkeypatch.setattr("os.access", lambda *_: False)
    from emaphm.simulation.engine.kernel_cache import kernel_folder

    kernel_folder.cache_clear()
    try:
        assert "EMAPHM_CACHE_DIR" in str(environment.environment())
    finally:
        kernel_folder.cache_clear()
