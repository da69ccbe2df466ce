"""User templates: replacement of blocks, and the effect of errors in a template."""

import logging
from pathlib import Path

import pytest

from emaphm.actuator import Actuator
from emaphm.errors import ServerError
from emaphm.server.html import check_templates
from emaphm.server.run import running

from .conftest import WITHOUT_WORKERS, client_of

PAGE = "events.html.jinja"
EXTENDED = '{% extends "emaphm/events.html.jinja" %}{% block title %}'


def shown(fleet: Path, folder: Path) -> str:
    """Return the page of events, rendered with the templates in a folder."""
    check_templates(folder)
    thesis = {"thesis": Actuator.thesis()}
    with running(str(fleet), None, None, thesis, WITHOUT_WORKERS, templates=folder) as state:
        answer = client_of(state).get("/events")
    assert answer.status_code == 200
    return answer.text


def test_a_template_replaces_a_block_of_a_page(fleet: Path, tmp_path: Path) -> None:
    (tmp_path / PAGE).write_text(EXTENDED + "Hangar 3 {{ '<b>' }}{% endblock %}")
    page = shown(fleet, tmp_path)
    assert "<title>Hangar 3 &lt;b&gt;" in page
    assert "friction is degraded" in page


@pytest.mark.parametrize(
    "text",
    [
        "{{ no_such_name }}",
        "{{ 1 / 0 }}",
        "{% include 'absent' %}",
        "{% include '../history.sqlite' %}",
        "{{ ''.__class__.__mro__[1].__subclasses__() }}",
        "{{ found.append(1) }}",
    ],
)
def test_a_template_with_an_error_is_replaced_by_the_default_page(
    fleet: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture, text: str
) -> None:
    (tmp_path / PAGE).write_text(f"{EXTENDED}{text}{{% endblock %}}")
    with caplog.at_level(logging.WARNING, "emaphm.server"):
        page = shown(fleet, tmp_path)
    assert "friction is degraded" in page
    assert f"{tmp_path}: {PAGE}: " in caplog.text


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        (PAGE, b"a\n{% if %}", "events.html.jinja, line 2: Expected an expression"),
        (PAGE, b"{{ 1 | no_such_filter }}", "No filter named 'no_such_filter'"),
        (PAGE, b"\xff", "events.html.jinja: 'utf-8' codec can't decode"),
        ("event.html.jinja", b"", "did you mean 'events.html.jinja'"),
        ("events.html", b"", "has no file that ends in .html.jinja; pages: base.html.jinja, "),
    ],
)
def test_invalid_templates_are_refused_at_the_start(
    tmp_path: Path, name: str, content: bytes, reason: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ServerError) as caught:
        check_templates(tmp_path)
    assert reason in str(caught.value)


def test_a_missing_folder_of_templates_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ServerError, match="no such folder"):
        check_templates(tmp_path / "absent")
