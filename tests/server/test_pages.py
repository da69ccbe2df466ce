"""The pages against the content of the history: order, filters, texts and accessibility."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from typing import TYPE_CHECKING

import pytest

from emaphm.history import Entry, History, Removal
from emaphm.server import pages

from .conftest import UNITS
from .made_up import diagnosis, recording

if TYPE_CHECKING:
    from starlette.testclient import TestClient

    from emaphm.server.state import ServerState

PAGES = ("/", "/units/2", "/diagnoses/3", "/upload", "/data", "/events", "/login", "/nothing-here")


class Page(HTMLParser):
    """Tags of a page with their attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Store a tag with its attributes."""
        self.tags.append((tag, dict(attrs)))

    def all(self, name: str) -> list[dict[str, str | None]]:
        """Return the attributes of each tag with this name."""
        return [attributes for tag, attributes in self.tags if tag == name]


def units_on(client: "TestClient", path: str) -> list[str]:
    return re.findall(r'<th scope="row"><a href="/units/\d+">([^<]+)</a>', client.get(path).text)


def test_units_are_listed_by_urgency(reader: "TestClient") -> None:
    # In the synthetic advice, every fifth unit is to be replaced; lower numbers are to be replaced sooner.
    assert units_on(reader, "/")[:4] == ["SN-0004", "SN-0009", "SN-0003", "SN-0008"]
    assert len(units_on(reader, "/")) == 8
    assert units_on(reader, "/?page=2")[-1] == "SN-0011"


def test_queries_sort_and_filter_the_fleet(reader: "TestClient") -> None:
    assert units_on(reader, "/?sort=unit") == [f"SN-{i:04d}" for i in range(8)]
    assert units_on(reader, "/?sort=unit&order=desc")[0] == "SN-0011"
    assert units_on(reader, "/?advice=replace+before&sort=rul&order=desc") == ["SN-0009", "SN-0004"]
    assert units_on(reader, "/?part=EMA-1&sort=unit") == ["SN-0001", "SN-0004", "SN-0007", "SN-0010"]
    assert units_on(reader, "/?health=not+explained") == ["SN-0005"]
    assert units_on(reader, "/?search=0007") == ["SN-0007"]
    assert units_on(reader, "/?search=no+such") == []
    assert units_on(reader, "/?sort=&order=&part=&advice=&health=&page=9")[-1] == "SN-0011"


def test_an_unchanged_fleet_is_answered_with_304(client: "TestClient", state: "ServerState") -> None:
    tag = client.get("/?sort=unit").headers["etag"]
    assert client.get("/?sort=unit", headers={"if-none-match": tag}).status_code == 304
    assert client.get("/", headers={"if-none-match": tag}).status_code == 200
    state.history.add_removal("SN-0001", Removal(900.0, "failed"))
    assert client.get("/?sort=unit", headers={"if-none-match": tag}).status_code == 200


def test_the_page_of_a_unit_shows_its_recordings_entries_and_events(reader: "TestClient") -> None:
    text = reader.get("/units/3").text
    for part in ("SN-0002", "flight 8.csv", "suspected", "slow to respond", "backlash degraded", "Fan chart"):
        assert part in text
    assert "friction is degraded" in reader.get("/units/2").text


def test_pages_show_exact_hours_and_counts(client: "TestClient", state: "ServerState") -> None:
    assert "1 removal, 1 finding of the shop." in client.get("/units/3").text
    held = recording(1000)
    state.history.add(Entry("SN-0000", "EMA-0", 1166.5), held, diagnosis(held, 0.0))
    state.history.add_removal("SN-0000", Removal(1166.5, "other"))
    text = client.get("/units/1").text
    assert "SN-0000 at 1,166.5\u00a0h" in text
    assert text.count("1,166.5\u00a0h</") == 3  # of unit, recording and removal
    assert "1 removal, 0 findings of the shop." in text
    assert '<td data-label="flight hours" class="number">1,166.5\u00a0h</td>' in client.get("/").text


def test_the_pages_show_no_remaining_life_for_a_failed_unit(
    client: "TestClient", state: "ServerState"
) -> None:
    kept = state.history.prognoses()["SN-0002"]
    # The shop has named no failed component.
    document = {**kept.document, "failed_at_hours": 160.0, "component": None, "requirement": None}
    state.history.keep_prognosis(
        "SN-0002", replace(kept, document=document, basis=replace(kept.basis, at="2099-01-02T00:00:00Z"))
    )
    assert client.get("/?search=0002").text.count("failed at 160") == 1
    text = client.get("/units/3").text
    assert "none: failed at 160" in text
    assert "<dt>Failed</dt><dd>cause not found</dd>" in text
    assert "in sight" not in text


def test_the_page_of_a_diagnosis_shows_its_verdicts_and_estimates(reader: "TestClient") -> None:
    assert "Not reliable" in reader.get("/diagnoses/18").text
    text = reader.get("/diagnoses/36").text
    assert "Degraded: friction." in text
    assert "0.1100" in text


def test_the_verdict_cannot_tell_is_not_shown_as_healthy(client: "TestClient", state: "ServerState") -> None:
    held = recording(1000)
    result = diagnosis(held, 0.0)
    undecided = {
        name: replace(estimate, verdict="cannot tell") for name, estimate in result.components.items()
    }
    state.history.add(Entry("SN-new", "EMA-9", 5.0), held, replace(result, components=undecided))
    [line] = client.get("/api/v1/diagnoses?limit=1").json()["diagnoses"]
    assert (line["explained"], line["health"], line["degraded"]) == (True, "cannot tell", [])
    assert units_on(client, "/?health=cannot+tell") == ["SN-new"]
    assert '<td data-label="degraded">cannot tell</td>' in client.get(f"/units/{line['unit_id']}").text
    assert "but some components are inconclusive" in client.get(f"/diagnoses/{line['id']}").text
    assert '<td data-label="degraded">none</td>' in client.get("/units/1").text


def test_a_long_list_of_recordings_is_divided_into_pages(
    client: "TestClient", monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pages, "MOST_LISTED", 2)
    for path in ("/units/6", "/data"):  # each with the recordings of SN-0005
        first, second = client.get(path).text, client.get(f"{path}?page=2").text
        assert "<caption>The newest 2 of 3 recordings.</caption>" in first
        assert f'<a rel="next" href="{path}?page=2#recordings">' in first
        assert "<caption>3 to 3 of 3 recordings, counted from the newest.</caption>" in second
        assert f'<a rel="prev" href="{path}?page=1#recordings">' in second
        assert [re.findall(r"flight \d+\.csv</a>", text) for text in (first, second)] == [
            ["flight 17.csv</a>", "flight 16.csv</a>"],
            ["flight 15.csv</a>"],
        ]
        assert client.get(f"{path}?page=9").text == second
    monkeypatch.setattr(pages, "MOST_LISTED", 3)
    assert "<caption>3 recordings.</caption>" in client.get("/units/6").text


def test_data_health_lists_recordings_that_are_not_explained(reader: "TestClient") -> None:
    text = reader.get("/data").text
    assert units_on(reader, "/data")[0] == "SN-0005"
    assert "flight 17.csv" in text
    assert "three times as large" in text


def test_new_entries_are_shown_at_once(client: "TestClient", state: "ServerState") -> None:
    assert "SN-new" not in client.get("/").text
    held = recording(1000)
    with History.open(state.history.database.address.shown) as second_connection:
        second_connection.add(Entry("SN-new <b>", "EMA-9", 5.0), held, diagnosis(held, 0.3))
        second_connection.add_removal("SN-0001", Removal(900.0, "failed"))
    assert "SN-new &lt;b&gt;" in client.get("/?part=EMA-9").text
    assert client.get("/api/v1/units").json()["total"] == UNITS + 1
    [row] = client.get("/api/v1/units?search=SN-0001").json()["units"]
    assert row["position"] is None


@pytest.mark.parametrize("path", PAGES)
def test_pages_contain_no_inline_code_and_are_accessible(reader: "TestClient", path: str) -> None:
    answer = reader.get(path)
    assert answer.headers["content-security-policy"].startswith("default-src 'self';")
    page = Page(answer.text)
    assert not [
        attributes
        for _, attributes in page.tags
        if "style" in attributes or any(name.startswith("on") for name in attributes)
    ]
    assert not page.all("style")
    assert all(attributes["src"] for attributes in page.all("script"))
    assert all(attributes["alt"] for attributes in page.all("img"))
    assert all(attributes.get("scope") in {"col", "row"} for attributes in page.all("th"))
    assert len(page.all("h1")) == 1
    addresses = [
        attributes.get("src") or attributes.get("href") or ""
        for _, attributes in page.tags
        if "src" in attributes or "href" in attributes
    ]
    assert all(target.startswith(("/", "#")) for target in addresses)


@pytest.mark.usefixtures("warm_workers")
def test_a_figure_is_a_sandboxed_svg(client: "TestClient") -> None:
    answer = client.get("/units/2/life.svg")
    assert answer.headers["content-type"] == "image/svg+xml"
    assert "sandbox" in answer.headers["content-security-policy"]
    assert b"<svg" in answer.content
    assert client.get("/units/2/life.svg").content == answer.content
    assert client.get("/units/2/other.svg").status_code == 404
