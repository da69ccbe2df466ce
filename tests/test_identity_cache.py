"""The cache by identity: one evaluation for each object, and none shared by equal objects."""

from emaphm.identity_cache import KEPT, cached_by_identity


def test_each_object_is_evaluated_once_and_equal_objects_separately() -> None:
    evaluated = list[tuple[int, ...]]()

    @cached_by_identity
    def total(values: tuple[int, ...]) -> int:
        evaluated.append(values)
        return sum(values)

    first = (1, 2)
    equal = (*first,)
    assert equal is not first
    assert [total(first), total(first), total(equal)] == [3, 3, 3]
    assert len(evaluated) == 2
    for i in range(KEPT + 5):  # each new tuple may have the memory of one that was dropped
        assert total((i, i)) == 2 * i
