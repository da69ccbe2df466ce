"""Pages of Markdown: tables, and what every page says of the study behind it."""

from collections.abc import Iterable, Sequence


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table, its numbers to the right."""
    rule = ["---", *["---:"] * (len(header) - 1)]
    return "\n".join(f"| {' | '.join(row)} |" for row in [header, rule, *rows])


def incomplete(done: int, total: int) -> list[str]:
    """Return a warning where only `done` of `total` runs are finished, else nothing."""
    if done >= total:
        return []
    return [f"> **The study is not complete: {done} of {total} runs. All figures may yet change.**\n"]
