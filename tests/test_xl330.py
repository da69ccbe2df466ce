"""A measured servo: the XL330 logs of Rhoban/bam, predicted from their command by a fit to other logs.

The bound is what BAM's model M6, fitted to the same four logs by its own loss (mean absolute error), has on
the other four: 43 mrad (M1 64, M4 48). For the reverse split, which takes the same time and is not tested, it
is 30 mrad (M1 50, M4 37); the example with `--train` and `--test` exchanged gives its figure.
"""

import importlib
import importlib.util
import json
import os
import runpy
import sys
from pathlib import Path
from typing import Any

import pytest

from emaphm.estimation.joint import uncertainty

ROOT = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get("EMAPHM_DATA", ROOT.parent / "shared" / "data")) / "xl330"
ONE = ("kp100_sin_sin", "kp200_lift_and_drop", "kp400_up_and_down", "kp800_sin_time_square")
OTHER = ("kp100_up_and_down", "kp200_sin_time_square", "kp400_sin_sin", "kp800_lift_and_drop")


BY_M6 = 43.0
"""Mean absolute error of BAM's model M6 on `OTHER` [mrad]."""


@pytest.fixture
def parameters_alone(monkeypatch: pytest.MonkeyPatch, no_model_error: None) -> None:  # noqa: ARG001
    """Let a calibration estimate only the parameters: its later steps change none and take half the time.

    These steps are a fit of each log alone (contradictions), a fit without each log (model error), and the
    search for parameters with similar effects.
    """
    monkeypatch.setattr(uncertainty, "_alone", lambda *_: None)
    module = importlib.import_module("emaphm.calibration.calibrate")  # a function has its name
    monkeypatch.setattr(module, "collinear_parameters", lambda *_: ())


@pytest.mark.evidence
@pytest.mark.usefixtures("parameters_alone")
def test_held_out_logs_are_predicted_better_than_by_m6(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if not DATA.is_dir():
        pytest.skip(f"the XL330 logs are not in {DATA}; set EMAPHM_DATA to the folder that holds xl330")
    arguments = ("--train", *_files(ONE), "--test", *_files(OTHER), "--json")
    monkeypatch.setattr(sys, "argv", ["xl330.py", *arguments])
    _run_example()
    errors: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert errors["test_mae_mrad"] < BY_M6
    assert errors["test_mae_mrad"] < errors["test_rms_mrad"]
    assert {"load-dependent", "gravity"} <= set(errors["laws"])


def test_missing_logs_are_reported_in_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("EMAPHM_DATA", str(tmp_path))
    monkeypatch.setattr(sys, "argv", ["xl330.py"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(ROOT / "examples" / "xl330" / "xl330.py"), run_name="__main__")
    # Python writes it to stderr, and its status is 1.
    exit_code = ended.value.code
    assert isinstance(exit_code, str)
    assert exit_code.startswith(f"error: {tmp_path}")
    assert "\n" not in exit_code


def _files(names: tuple[str, ...]) -> list[str]:
    return [str(DATA / f"{name}.csv") for name in names]


def _run_example() -> None:
    spec = importlib.util.spec_from_file_location("xl330", ROOT / "examples" / "xl330" / "xl330.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["xl330"] = module  # dataclasses look up their module
    spec.loader.exec_module(module)
    module.main()
