"""Parts of all Markdown pages: warnings on the study's state, and shares in percent."""

from collections.abc import Collection


def incomplete(done: int, total: int) -> list[str]:
    """Return a warning if only `done` of `total` runs are finished, otherwise nothing."""
    if done >= total:
        return []
    return [f"> **The study is not complete: {done} of {total} runs. All figures may yet change.**\n"]


def mixed(revisions: Collection[str]) -> list[str]:
    """Return a warning if results of several `revisions` of the models are mixed, otherwise nothing."""
    several = mixed_revisions(revisions)
    return [f"> **{several}**\n"] if several else []


def mixed_revisions(revisions: Collection[str]) -> str:
    """Return a sentence on results of several `revisions` of the models; empty for a single revision."""
    names = sorted(set(revisions))
    if len(names) < 2:
        return ""
    return (
        f"Results of {len(names)} versions of the models are mixed: {', '.join(names)}. Differences between "
        "figures may come from these."
    )


def percent(share: float) -> str:
    """Return a share in percent, with a decimal only where it is needed to distinguish it from 0 or 100 %."""
    rounded = f"{100 * share:.0f} %"
    return f"{100 * share:.1f} %" if rounded in ("0 %", "100 %") and 0 < share < 1 else rounded
