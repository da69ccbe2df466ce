"""Commands, compared with closed forms."""

import copy
import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.actuator import Chirp, Command, DecayingChirp, Ramp, Sampled, Sine, Step
from emaphm.actuator.commands import rest_position
from emaphm.arrays import Array
from emaphm.errors import SignalError


def zero_crossings(signal: Callable[[Array], Array], start: float, stop: float) -> Array:
    """Return the times of the sign changes of the signal, by linear interpolation in a fine grid."""
    t = np.linspace(start, stop, 200_001)
    x = signal(t)
    rows_before = np.flatnonzero(x[:-1] * x[1:] < 0)
    return np.asarray(
        t[rows_before]
        - x[rows_before] * (t[rows_before + 1] - t[rows_before]) / (x[rows_before + 1] - x[rows_before])
    )


def test_a_step_changes_at_its_time() -> None:
    t = np.array([0.0, 0.0999, 0.1, 5.0])
    assert Step(2e-3, start=0.1)(t).tolist() == [0.0, 0.0, 2e-3, 2e-3]
    assert Step()(t).tolist() == [5e-3] * 4


def test_a_ramp_rises_from_its_start_and_is_held_at_its_limit() -> None:
    t = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 9.0])
    expected = np.array([0.0, 0.0, 0.1, 0.2, 0.25, 0.25])
    np.testing.assert_allclose(Ramp(0.2, start=0.5, limit=0.25)(t), expected, rtol=1e-15)
    np.testing.assert_allclose(Ramp(-0.2, start=0.5, limit=0.25)(t), -expected, rtol=1e-15)
    np.testing.assert_allclose(Ramp(0.2)(t), 0.2 * t, rtol=1e-15)


@pytest.mark.parametrize("limit", [-0.25, 0.0, np.nan])
def test_the_limit_of_a_ramp_is_a_magnitude(limit: float) -> None:
    with pytest.raises(SignalError, match="give one above 0"):
        Ramp(-0.2, limit=limit)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (kind, field.name)
        for kind in (Step, Ramp, Sine, Chirp, DecayingChirp)
        for field in fields(kind)
        if field.name != "limit"
    ],
)
def test_a_value_that_is_not_a_finite_number_is_refused(kind: type, name: str, value: float) -> None:
    with pytest.raises(SignalError, match=r"is nan|inf, which is no finite number|sweeps nothing"):
        kind(**{name: value})


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))])  # noqa: S301 - pickled by this test
def test_copies_of_a_sampled_signal_are_equal_and_read_only(duplicate: Callable[[Sampled], Sampled]) -> None:
    copy_ = duplicate(Sampled([0.0, 1.0], [2.0, 4.0]))
    assert (copy_.time_s.tolist(), copy_.values.tolist()) == ([0.0, 1.0], [2.0, 4.0])
    assert not copy_.time_s.flags.writeable
    assert not copy_.values.flags.writeable


def test_a_sampled_signal_has_no_masked_values_and_no_dates() -> None:
    masked = np.ma.masked_array([2.0, 4.0], mask=[False, True])
    with pytest.raises(SignalError, match="row 2 of the sampled signal is not finite"):
        Sampled([0.0, 1.0], masked)
    with pytest.raises(SignalError, match="of dates; give seconds"):
        Sampled(np.array(["2026-11-28", "2026-11-29"], "datetime64[s]"), [2.0, 4.0])
    assert Sampled(np.array([0, 500], "timedelta64[ms]"), [2.0, 4.0])(np.array([0.25])).tolist() == [3.0]


def test_a_sine_has_its_frequency_and_amplitude() -> None:
    quarter = 1 / (4 * 7.0)
    values = Sine(3e-3, 7.0)(quarter * np.arange(5.0))
    np.testing.assert_allclose(values, [0, 3e-3, 0, -3e-3, 0], atol=1e-17)


@pytest.mark.parametrize("kind", [Chirp, DecayingChirp])
@pytest.mark.parametrize(
    ("start_hz", "stop_hz", "duration"),
    [(0.0, 15.0, 0.5), (3.0, 40.0, 1.5), (50.0, 5.0, 0.4), (8.0, 8.0, 1.0)],
)
def test_the_frequency_of_a_chirp_changes_linearly_between_its_ends(
    kind: type[Chirp | DecayingChirp], start_hz: float, stop_hz: float, duration: float
) -> None:
    crossings = zero_crossings(kind(1.0, start_hz, stop_hz, duration), 1e-3, duration)
    assert crossings.size > 5
    # Half a turn lies between crossings, and a linear frequency equals its mean midway between them.
    measured = 0.5 / np.diff(crossings)
    middle = (crossings[1:] + crossings[:-1]) / 2
    expected = start_hz + (stop_hz - start_hz) * middle / duration
    # Interpolation in a grid of 7.5 us at most leaves 1e-4 of a half period of 10 ms or more.
    np.testing.assert_allclose(measured, expected, rtol=1e-4)


@pytest.mark.parametrize("kind", [Chirp, DecayingChirp])
def test_a_chirp_starts_at_zero_upwards(kind: type[Chirp | DecayingChirp]) -> None:
    chirp = kind(2e-3, 5.0, 15.0, 0.5)
    t = np.array([0.0, 1e-6])
    assert chirp(t)[0] == 0.0
    # 2 pi f A dt, with the envelope and the sweep a relative change of a few 1e-6.
    assert chirp(t)[1] == pytest.approx(2 * np.pi * 5.0 * 2e-3 * 1e-6, rel=1e-5)


def test_the_default_chirp_is_the_manoeuvre_of_physics_section_1() -> None:
    t = np.linspace(0, 0.5, 5001)
    x = Chirp()(t)
    assert np.abs(x).max() == pytest.approx(5e-3, rel=1e-4)  # the grid misses a peak by 1e-4 at most
    # The phase at the end, pi (0 + 15) 0.5: 3.75 turns.
    assert x[-1] == pytest.approx(5e-3 * np.sin(2 * np.pi * 3.75), rel=1e-12)


@given(t=st.floats(0, 2), amplitude=st.floats(1e-6, 10), duration=st.floats(0.1, 1.5))
def test_the_envelope_of_the_decaying_chirp_falls_linearly_to_zero(
    t: float, amplitude: float, duration: float
) -> None:
    at = np.array([t])
    full, decaying = Chirp(amplitude, 1, 9, duration)(at), DecayingChirp(amplitude, 1, 9, duration)(at)
    np.testing.assert_allclose(decaying, full * max(1 - t / duration, 0.0), rtol=1e-12, atol=0)
    assert np.abs(full) <= amplitude


def test_a_sampled_signal_is_linear_between_its_rows_and_held_outside() -> None:
    signal = Sampled([1.0, 2.0, 4.0], [10.0, 20.0, 0.0])
    t = np.array([0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 9.0])
    assert signal(t).tolist() == [10.0, 10.0, 15.0, 20.0, 10.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("time_s", "values", "complaint"),
    [
        ([0.0, 1.0], [1.0, 2.0, 3.0], r"two equal columns of 2 rows or more, got \(2,\), \(3,\)"),
        ([0.0], [1.0], r"2 rows or more"),
        ([[0.0, 1.0]], [[1.0, 2.0]], r"two equal columns"),
        ([0.0, 1.0, 1.0], [1.0, 2.0, 3.0], "times of a sampled signal must increase; row 3 does not"),
        ([0.0, -1.0, 1.0], [1.0, 2.0, 3.0], "row 2 does not"),
        (
            [0.0, 1.0, 2.0],
            [1.0, np.nan, 3.0],
            "row 2 of the sampled signal is not finite; correct or drop it",
        ),
        ([0.0, 1.0, np.inf], [1.0, 2.0, 3.0], "row 3 of the sampled signal is not finite"),
    ],
)
def test_a_malformed_sampled_signal_is_refused(
    time_s: list[float], values: list[float], complaint: str
) -> None:
    with pytest.raises(SignalError, match=complaint):
        Sampled(time_s, values)


def test_a_sampled_signal_keeps_a_copy_of_its_values() -> None:
    values = np.array([1.0, 2.0])
    signal = Sampled(np.array([0.0, 1.0]), values)
    values[:] = 9.0
    assert signal(np.array([0.0])).tolist() == [1.0]


def test_sampled_signals_can_be_compared_and_hashed() -> None:
    first, second = Sampled([0, 1], [0, 1]), Sampled([0, 1], [0, 2])
    assert first != second
    assert len({first, second}) == 2


@pytest.mark.parametrize("kind", [Step, Ramp, Sine, Chirp, DecayingChirp])
@given(about=st.floats(-1.0, 1.0))
def test_a_command_by_name_is_relative_to_the_rest_position(
    kind: Callable[..., Command], about: float
) -> None:
    t, moved = np.linspace(0.0, 0.6, 301), kind(about=about)
    np.testing.assert_allclose(moved(t) - about, kind()(t), rtol=0, atol=1e-15)
    assert rest_position(moved) == about
    assert rest_position(Sampled([0.0, 1.0], [about, 0.0])) == 0


COMMANDS = (Step(), Ramp(), Sine(), Chirp(), DecayingChirp(), Sampled([0, 1], [0, 1]))


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_are_frozen(command: object) -> None:
    name = next(iter(vars(command)))
    with pytest.raises(FrozenInstanceError):
        setattr(command, name, 1.0)
