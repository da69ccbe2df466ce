"""A load that steps, against a ramp by another library and against a load as a function of time."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.actuator import Chirp, Faults
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, REFERENCE, Model
from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.running import observe_batch
from emaphm.simulation.laws.load_steps import step_load, step_names
from simulation.rig import THESIS, altered

DURATION = 0.1
CURRENT_LOOP = {"current_gain": 1.0, "current_integral_gain": 500.0, "pwm_frequency": 2e4}

STEPS = np.array([[0.1, 0.02, 0.0], [-0.05, 0.051, 0.01]])
"""Size [N·m], time [s] and rise time [s] of two steps."""


@given(
    size=st.floats(-1.0, 1.0),
    instant=st.floats(-0.1, 1.1),
    rise=st.floats(1e-3, 0.5),
    times=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20),
)
def test_a_step_is_a_ramp_about_its_instant(
    size: float, instant: float, rise: float, times: list[float]
) -> None:
    ramp = np.interp(times, [instant - rise / 2, instant + rise / 2], [0.0, size])
    np.testing.assert_allclose(step_load(size, instant, rise, np.array(times), 1e-4), ramp, atol=1e-9)


def test_a_step_without_rise_time_takes_one_interval_and_shifts_with_its_time() -> None:
    middles = np.arange(100) + 0.5
    for instant in (40.0, 40.3, 40.5, 40.9):
        load = step_load(2.0, instant, 0.0, middles, 1.0)
        assert np.sum((load > 0) & (load < 2.0)) <= 1
        assert load.sum() == pytest.approx(2.0 * (100 - instant))


def by_time(steps: Array) -> Any:
    """Return the load by `steps` (n, 3) as a function of time."""

    def load(time: Any) -> Array:
        ramps = (np.interp(time, [t - max(r, 1e-9) / 2, t + max(r, 1e-9) / 2], [0.0, s]) for s, t, r in steps)
        return np.asarray(0.05 + sum(ramps))

    return load


@pytest.mark.parametrize(
    ("model", "drive"),
    [(AVERAGED, "hysteresis"), (REFERENCE, "hysteresis"), (REFERENCE, "six-step"), (AVERAGED, "foc")],
)
def test_a_load_by_parameters_acts_like_the_same_load_by_time(model: Model, drive: str) -> None:
    actuator = THESIS if drive == "hysteresis" else altered(drive={"kind": drive, **CURRENT_LOOP})
    faults = np.tile(Faults(friction=0.2).vector, (17, 1))
    # Enough lanes for two groups, each with its steps, at the edges of integration steps.
    sizes, late = np.linspace(0.5, 1.5, 17), np.array([0.0, model.step / 2, 0.0])
    steps = {
        name: value * (sizes if part == 0 else 1.0)
        for i, step in enumerate(STEPS, 1)
        for part, (name, value) in enumerate(zip(step_names(i), step + late, strict=True))
    }

    def observed(count: int, load: Any, parameters: Any) -> Array:
        inputs = Inputs.of(Chirp(), load, samples=500, interval=DURATION / 500, step=model.step)
        return observe_batch(model, Plant.of(actuator, faults[:count], parameters), inputs, workers=1)

    signals = observed(17, 0.05, steps)
    for lane in (0, 16):
        expected = observed(1, by_time(STEPS * [sizes[lane], 1.0, 1.0]), {})[0]
        scale = np.abs(expected).max(axis=1, keepdims=True)
        # A load by time is evaluated at the start of an integration step, a load step at its middle.
        np.testing.assert_allclose(signals[lane] / scale, expected / scale, rtol=0, atol=2e-3)
