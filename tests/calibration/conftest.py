"""What several files of calibrations share."""

import importlib

import pytest

from emaphm.actuator.model_error import NOT_LEARNED


@pytest.fixture
def no_model_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a calibration learn no model's error, which moves no parameter: to save time where it is not asked.

    That it is learned is tested in `tests/calibration/test_model_error.py`.
    """
    module = importlib.import_module("emaphm.calibration.calibrate")  # a function has its name
    monkeypatch.setattr(module, "learned_model_error", lambda *_: NOT_LEARNED)
