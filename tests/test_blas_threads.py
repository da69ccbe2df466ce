"""Linear algebra uses one thread while the package computes, and the earlier number afterwards."""

import sys
from contextlib import ExitStack
from unittest.mock import Mock

import pytest
from threadpoolctl import ThreadpoolController, threadpool_info, threadpool_limits

import emaphm as ema
from cases import THESIS
from emaphm.blas_threads import one_blas_thread


def threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_the_last_exit_restores_the_number_of_threads() -> None:
    with threadpool_limits(2, user_api="blas"):
        first, second = ExitStack(), ExitStack()
        first.enter_context(one_blas_thread())
        second.enter_context(one_blas_thread())
        first.close()
        assert threads() == {1}
        second.close()
        assert threads() == {2}


def test_the_number_of_threads_is_restored_after_an_error() -> None:
    @one_blas_thread()
    def fails() -> None:
        raise KeyError("x")

    with threadpool_limits(2, user_api="blas"):
        with pytest.raises(KeyError, match="x"):
            fails()
        assert threads() == {2}


def test_libraries_are_searched_again_after_an_import(monkeypatch: pytest.MonkeyPatch) -> None:
    search = Mock(side_effect=ThreadpoolController)
    monkeypatch.setattr("threadpoolctl.ThreadpoolController", search)

    def in_a_limit() -> int:
        with one_blas_thread():
            return search.call_count

    before = in_a_limit()
    assert in_a_limit() == before
    monkeypatch.setitem(sys.modules, "a module of linear algebra", sys)
    assert in_a_limit() == before + 1


def test_a_diagnosis_uses_one_thread() -> None:
    recording = ema.simulate(THESIS, ema.Chirp(amplitude=5e-3, stop_hz=15))
    counts: set[int] = set()
    with threadpool_limits(2, user_api="blas"):
        ema.diagnose(recording, THESIS, max_corrections=0, on_progress=lambda _: counts.update(threads()))
    assert counts == {1}
