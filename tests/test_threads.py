"""Work in threads: results are in the order of the items, and what is raised arrives."""

import threading

import pytest

from emaphm.threads import in_threads


@pytest.mark.parametrize("workers", [1, 2, 7, None])
def test_results_are_in_the_order_of_the_items(workers: int | None) -> None:
    assert in_threads(lambda i: i * i, range(5), workers) == [0, 1, 4, 9, 16]
    assert in_threads(lambda i: i, [], workers) == []


def test_items_are_worked_on_at_the_same_time_by_several_and_in_turn_by_one() -> None:
    together = threading.Barrier(3, timeout=10)
    in_threads(lambda _: together.wait(), range(3), 3)  # would time out in turn
    assert set(in_threads(lambda _: threading.current_thread(), range(3), 1)) == {threading.current_thread()}


@pytest.mark.parametrize("workers", [1, 2])
def test_progress_is_reported_by_who_asked(workers: int) -> None:
    reported = []
    in_threads(lambda i: i, range(4), workers, lambda done: reported.append((done, threading.get_ident())))
    assert reported == [(share, threading.get_ident()) for share in (0.25, 0.5, 0.75, 1.0)]


def test_what_is_raised_for_one_is_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        in_threads(lambda i: 1 // i, [1, 0, 2], 2)
