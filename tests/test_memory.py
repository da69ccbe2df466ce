"""A cache of limited size that drops the value that was not used for the longest time."""

from emaphm.memory import Memory


def test_the_least_recently_used_value_is_dropped() -> None:
    computed: list[str] = []
    memory: Memory[str] = Memory(2)
    for key in ("a", "b", "a", "c", "a", "b"):
        assert memory.get(key, lambda key=key: computed.append(key) or key) == key  # type: ignore[misc, func-returns-value]
    assert computed == ["a", "b", "c", "b"]
