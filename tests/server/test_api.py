"""The API against the history; invalid requests are refused with a 4xx status."""

from typing import TYPE_CHECKING, Any

import pytest

from emaphm.history import Event, Finding, History, reading

if TYPE_CHECKING:
    from starlette.testclient import TestClient

    from emaphm.server.state import ServerState

API = "/api/v1"


def test_listed_units_agree_with_the_history(reader: "TestClient", unchanged: "ServerState") -> None:
    answer = reader.get(f"{API}/units?sort=unit").json()
    with History.open(unchanged.history.database.address.shown) as history:
        states = {state.serial_number: state for state in history.states()}
    assert [unit["unit"] for unit in answer["units"]] == sorted(states)
    for unit in answer["units"]:
        state = states[unit["unit"]]
        assert (unit["hours"], unit["recordings"], unit["explained"]) == (
            state.hours,
            state.recordings,
            state.explained,
        )
        assert unit["current"]


def test_a_unit_its_diagnosis_and_its_prognosis_agree_with_the_history(
    reader: "TestClient", unchanged: "ServerState"
) -> None:
    unit = reader.get(f"{API}/units/3").json()
    assert unit["unit"]["unit"] == "SN-0002"
    assert unit["removals"][0]["reason"] == "suspected"
    [*_, last] = reader.get(f"{API}/diagnoses?unit_id=3").json()["diagnoses"]
    diagnosis = reader.get(f"{API}/diagnoses/{last['id']}").json()
    kept = unchanged.history.unit("SN-0002").diagnoses()[0]
    assert diagnosis["data_manipulation"]["recording_hash"] == kept.recording_hash == last["recording_hash"]
    assert diagnosis["health_assessment"]["k"] == kept.vector.tolist()
    prognosis = reader.get(f"{API}/units/3/prognosis").json()
    assert prognosis["advice"] == unchanged.history.prognoses()["SN-0002"].document["advice"]
    assert reader.get(f"{API}/prognoses").json()["SN-0002"] == prognosis
    assert reader.get(f"{API}/units/3/curves").json()["unit"] == "made up"


def test_the_entries_of_a_unit_are_read_in_one_transaction(
    client: "TestClient", state: "ServerState", monkeypatch: pytest.MonkeyPatch
) -> None:
    before = client.get(f"{API}/units/3").json()
    removals = reading.removals

    def meanwhile(*arguments: Any) -> Any:
        entries = removals(*arguments)
        state.history.add_finding("SN-0002", Finding(160.0, "gain", "failed", replaced=True))
        return entries

    monkeypatch.setattr(reading, "removals", meanwhile)
    during = client.get(f"{API}/units/3").json()
    assert (during["findings"], during["lives"]) == (before["findings"], before["lives"])
    monkeypatch.undo()
    assert len(client.get(f"{API}/units/3").json()["findings"]) == len(before["findings"]) + 1


def test_consecutive_pages_of_diagnoses_are_complete(reader: "TestClient") -> None:
    first = reader.get(f"{API}/recordings?limit=5").json()["diagnoses"]
    second = reader.get(f"{API}/recordings?limit=5&before={first[-1]['id']}").json()["diagnoses"]
    assert [listed["id"] for listed in first + second] == list(range(36, 26, -1))
    assert all(
        not listed["explained"]
        for listed in reader.get(f"{API}/recordings?explained=false").json()["diagnoses"]
    )
    totals = {
        "limit=5": 36,
        "explained=false": 3,
        "explained=true&limit=2": 33,
        "unit_id=6&explained=false": 3,
    }
    for query, total in totals.items():
        assert reader.get(f"{API}/recordings?{query}").json()["total"] == total


def test_pages_of_unexplained_recordings_continue_below_the_lowest_number(reader: "TestClient") -> None:
    first = reader.get(f"{API}/data-health?limit=2").json()
    second = reader.get(f"{API}/data-health?limit=2&before={first['recordings'][-1]['id']}").json()
    assert [listed["id"] for listed in first["recordings"] + second["recordings"]] == [18, 17, 16]
    assert first["total"] == second["total"] == 3


def test_events_are_selected_by_unit_and_kind(reader: "TestClient") -> None:
    [event] = reader.get(f"{API}/events?unit_id=2").json()["events"]
    assert (event["event"], event["unit"]) == ("alarm", "SN-0001")
    assert reader.get(f"{API}/events?kind=sensor_fault").json() == {"events": [], "total": 0}


def test_consecutive_pages_of_events_are_complete(client: "TestClient", state: "ServerState") -> None:
    state.history.add_events(
        *(Event("refused", "raised", "warning", f"file {n}", f"{n}.csv") for n in range(5))
    )
    first = client.get(f"{API}/events?kind=refused&limit=2").json()
    second = client.get(f"{API}/events?kind=refused&limit=9&before={first['events'][-1]['number']}").json()
    assert [listed["message"][-1] for listed in first["events"] + second["events"]] == list("43210")
    assert first["total"] == second["total"] == 5
    assert client.get(f"{API}/events").json()["total"] == 6
    still_open = client.get(f"{API}/events?only_open=true&limit=1").json()
    assert ([listed["event"] for listed in still_open["events"]], still_open["total"]) == (["alarm"], 1)


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/units/999", 404),
        ("/units/0", 422),
        ("/units/99999999999999999999", 422),
        ("/units/3/other", 404),
        ("/units?sort=shoe-size", 422),
        ("/units?limit=0", 422),
        ("/diagnoses/999", 404),
        ("/diagnoses?unit_id=999", 404),
        ("/events?unit_id=999", 404),
        ("/events?kind=party", 422),
        ("/jobs/1", 404),
    ],
)
def test_invalid_paths_and_values_are_refused(reader: "TestClient", path: str, status: int) -> None:
    answer = reader.get(API + path)
    assert answer.status_code == status
    assert answer.json()["detail"]


@pytest.mark.parametrize(
    ("path", "reasons"),
    [
        ("/api/v1/events?since=2026-01-01", ["unknown name 'since'", "known: unit_id, kind, after"]),
        ("/api/v1/units?serch=SN-0001", ["unknown name 'serch' (did you mean 'search'?); known: sort, "]),
        ("/api/v1/units?Limit=1", ["unknown name 'Limit' (did you mean 'limit'?)"]),
        ("/api/v1/units/3/prognosis?hours=1", ["unknown name 'hours'; this address has no query"]),
        ("/api/v1/recordings?unit_id=1&unit_id=2", ["'unit_id' is given 2 times"]),
        ("/api/v1/jobs?a=1&b=2", ["unknown name 'a'", "unknown name 'b'"]),
        ("/?advise=fly+on", ["unknown name &#39;advise&#39; (did you mean &#39;advice&#39;?)"]),
        ("/diagnoses/3?explained=true", ["this address has no query"]),
        ("/?health=degrade", ["health: unknown value &#39;degrade&#39; (did you mean &#39;degraded&#39;?)"]),
        ("/?advice=bogus&order=up", ["advice: unknown value &#39;bogus&#39; (known: fly on, ", "order: "]),
        ("/?sort=hour", ["did you mean &#39;hours&#39;"]),
        ("/?page=abc", ["page: Input should be a valid integer"]),
        ("/units/3?page=0", ["page: Input should be greater than or equal to 1"]),
        ("/?part=EMA-7", ["part: unknown value &#39;EMA-7&#39; (did you mean &#39;EMA-"]),
        ("/events?kind=alarms", ["kind: unknown value &#39;alarms&#39; (did you mean &#39;alarm&#39;?)"]),
        ("/api/v1/units?part=EMA-7", ["unknown value 'EMA-7' (did you mean 'EMA-"]),
        ("/api/v1/events?kind=alarms", ["unknown value 'alarms' (did you mean 'alarm'?)"]),
    ],
)
def test_queries_with_unknown_names_or_values_are_refused(
    reader: "TestClient", path: str, reasons: list[str]
) -> None:
    answer = reader.get(path)
    assert answer.status_code == 422
    assert all(reason in answer.text for reason in reasons)


def test_the_message_on_an_unknown_address_names_the_schema(reader: "TestClient") -> None:
    answer = reader.get(f"{API}/unit/3")
    assert answer.status_code == 404
    assert "/openapi.json" in answer.json()["detail"]


def test_fields_of_an_upload_in_the_query_are_refused(reader: "TestClient") -> None:
    answer = reader.post(f"{API}/recordings?late=true", data={"unit": "SN-0001", "hours": "900"})
    assert answer.status_code == 422
    assert answer.json()["detail"][0]["loc"] == ["query", "late"]


def test_the_schema_contains_the_api_and_the_upload_form(reader: "TestClient") -> None:
    paths = reader.get("/openapi.json").json()["paths"]
    assert all(path.startswith(API) for path in paths)
    assert "multipart/form-data" in paths[f"{API}/recordings"]["post"]["requestBody"]["content"]


@pytest.mark.parametrize("path", ["/api/v1/units", "/", "/static/style.css", "/api/v1/units/999"])
def test_a_head_request_has_the_status_and_headers_of_the_get_request(
    reader: "TestClient", path: str
) -> None:
    answer, head = reader.get(path), reader.head(path)
    assert head.status_code == answer.status_code
    assert head.headers == answer.headers
    assert head.content == b""
