"""Pages of Markdown: what every page says of the study behind it."""

from collections.abc import Collection


def incomplete(done: int, total: int) -> list[str]:
    """Return a warning where only `done` of `total` runs are finished, else nothing."""
    if done >= total:
        return []
    return [f"> **The study is not complete: {done} of {total} runs. All figures may yet change.**\n"]


def mixed(revisions: Collection[str]) -> list[str]:
    """Return a warning where results of several `revisions` of the models stand together, else nothing."""
    several = mixed_revisions(revisions)
    return [f"> **{several}**\n"] if several else []


def mixed_revisions(revisions: Collection[str]) -> str:
    """Return a sentence on results of several `revisions` of the models; empty where there is one."""
    names = sorted(set(revisions))
    if len(names) < 2:
        return ""
    return (
        f"Results of {len(names)} versions of the models are mixed: {', '.join(names)}. Differences between "
        "figures may come from these."
    )


def percent(share: float) -> str:
    """Return a share in percent, 0 and 100 only where it is none or all."""
    whole = f"{100 * share:.0f} %"
    return f"{100 * share:.1f} %" if whole in ("0 %", "100 %") and 0 < share < 1 else whole
