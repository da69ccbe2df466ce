"""What a process has computed is kept as long as it is asked for."""

from emaphm.memory import Memory


def test_what_was_not_asked_for_the_longest_is_forgotten() -> None:
    made: list[str] = []
    memory: Memory[str] = Memory(2)
    for key in ("a", "b", "a", "c", "a", "b"):
        assert memory.get(key, lambda key=key: made.append(key) or key) == key  # type: ignore[misc, func-returns-value]
    assert made == ["a", "b", "c", "b"]
