"""Work in threads: results are in the order of the items, and errors reach the caller."""

import threading

import pytest

from emaphm.threads import in_threads


@pytest.mark.parametrize("workers", [1, 2, 7, None])
def test_results_are_in_the_order_of_the_items(workers: int | None) -> None:
    assert in_threads(lambda i: i * i, range(5), workers) == [0, 1, 4, 9, 16]
    assert in_threads(lambda i: i, [], workers) == []


def test_several_threads_work_simultaneously_and_one_thread_in_sequence() -> None:
    together = threading.Barrier(3, timeout=10)
    in_threads(lambda _: together.wait(), range(3), 3)  # would time out one after the other
    assert set(in_threads(lambda _: threading.current_thread(), range(3), 1)) == {threading.current_thread()}


@pytest.mark.parametrize("workers", [1, 2])
def test_progress_is_reported_in_the_calling_thread(workers: int) -> None:
    reported = []
    in_threads(lambda i: i, range(4), workers, lambda done: reported.append((done, threading.get_ident())))
    assert reported == [(share, threading.get_ident()) for share in (0.25, 0.5, 0.75, 1.0)]


def test_an_error_for_one_item_is_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        in_threads(lambda i: 1 // i, [1, 0, 2], 2)
