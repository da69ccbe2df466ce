"""A measured servo: the XL330 logs of Rhoban/bam, predicted from their goal by a fit to other logs.

The bounds are what BAM's model M6, fitted to the same four logs by its own loss (mean absolute error), has on
the other four: 43 and 30 mrad for the example's split and its reverse (M1 64 and 50, M4 48 and 37).
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get("EMAPHM_DATA", ROOT.parent / "shared" / "data")) / "xl330"
ONE = ("kp100_sin_sin", "kp200_lift_and_drop", "kp400_up_and_down", "kp800_sin_time_square")
OTHER = ("kp100_up_and_down", "kp200_sin_time_square", "kp400_sin_sin", "kp800_lift_and_drop")


@pytest.mark.parametrize(("train", "test", "by_m6"), [(ONE, OTHER, 43.0), (OTHER, ONE, 30.0)])
def test_the_logs_left_out_are_predicted_better_than_by_m6(
    train: tuple[str, ...], test: tuple[str, ...], by_m6: float
) -> None:
    if not DATA.is_dir():
        pytest.skip(f"the XL330 logs are not in {DATA}; set EMAPHM_DATA to the folder that holds xl330")
    errors = _example("--train", *_files(train), "--test", *_files(test))
    assert errors["test_mae_mrad"] < by_m6
    assert errors["test_mae_mrad"] < errors["test_rms_mrad"]
    assert {"load-dependent", "gravity"} <= set(errors["laws"])


def _files(names: tuple[str, ...]) -> list[str]:
    return [str(DATA / f"{name}.csv") for name in names]


def _example(*arguments: str) -> dict[str, Any]:
    command = [sys.executable, str(ROOT / "examples" / "xl330" / "xl330.py"), *arguments, "--json"]
    done = subprocess.run(  # noqa: S603 - the arguments are this file's
        command, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    told: dict[str, Any] = json.loads(done.stdout)
    return told
