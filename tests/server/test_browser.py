"""The pages in headless Chromium, with and without JavaScript; no external request, an empty console."""

import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.recording import Recording, write_recording
from emaphm.server.access.tokens import add_token, read_tokens
from emaphm.server.work import worker
from emaphm.simulated_recording import simulate

from .conftest import SMALL
from .serving import served

pytest.importorskip("playwright", reason="needs playwright, of the extra 'dev'")

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
if CHROMIUM is None:
    pytest.skip("no Chromium: apt-get install chromium", allow_module_level=True)

pytestmark = pytest.mark.usefixtures("warm_workers")

WIDE, NARROW = {"width": 1280, "height": 900}, {"width": 390, "height": 844}

PATIENCE_MS = 180_000

ROWS = "main tbody th a"

CONTRAST = """() => {
  const channel = (c) => (c /= 255) <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
  const light = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
  const numbers = (text) => text.match(/[\\d.]+/g).map(Number);
  const behind = (one) => {
    for (; one; one = one.parentElement) {
      const colour = numbers(getComputedStyle(one).backgroundColor);
      if (colour.length < 4 || colour[3] > 0) return colour;
    }
    return [255, 255, 255];
  };
  const poor = [];
  for (const one of document.querySelectorAll("body *:not(svg *)")) {
    if (![...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim())) continue;
    const [a, b] = [light(numbers(getComputedStyle(one).color)), light(behind(one))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < 4.5) poor.push([one.outerHTML.slice(0, 80), ratio]);
  }
  return poor;
}"""
"""Script that returns texts with a contrast below 4.5, the minimum of WCAG 2.2 (AA, 1.4.3)."""


@pytest.fixture(scope="module")
def browser() -> "Iterator[Browser]":
    """Yield a browser."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def address(filled: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Yield the address of a server for all tests of this module."""
    file = tmp_path_factory.mktemp("served") / "fleet.sqlite"
    file.write_bytes(filled.read_bytes())
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("emaphm.server.work.pool.work", _quick_work)
        with served(file, settings=SMALL) as url:
            yield url


def _quick_work(*arguments: Any) -> None:
    """Run a worker of the server; its diagnoses have no corrections, which takes a tenth of the time."""
    import emaphm.diagnosis

    quick = partial(emaphm.diagnosis.diagnose, max_corrections=0, nuisances=())
    emaphm.diagnosis.diagnose = quick
    worker.work(*arguments)


@pytest.fixture
def opened(browser: "Browser") -> Iterator[Any]:
    """Yield a function that opens a page; check afterwards for external requests and console messages."""
    messages: list[str] = []
    contexts = []

    def open_page(*, scripts: bool = True, viewport: Any = WIDE) -> "Page":
        context = browser.new_context(java_script_enabled=scripts, viewport=viewport)
        context.set_default_timeout(PATIENCE_MS)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: messages.append(f"console: {message.text}"))
        page.on("pageerror", lambda error: messages.append(f"error: {error}"))
        page.on(
            "request",
            lambda request: (
                None
                if request.url.startswith("http://127.0.0.1:")
                else messages.append(f"request: {request.url}")
            ),
        )
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert messages == []


@pytest.mark.parametrize("scripts", [True, False])
def test_the_fleet_can_be_sorted_and_filtered(opened: Any, address: str, scripts: bool) -> None:
    page = opened(scripts=scripts)
    page.goto(address)
    assert page.locator(ROWS).first.inner_text() == "SN-0004"
    page.get_by_role("link", name="Unit", exact=True).click()
    assert page.locator(ROWS).first.inner_text() == "SN-0000"
    page.get_by_role("link", name="Unit ▲").click()
    assert page.locator(ROWS).first.inner_text() == "SN-0011"
    page.get_by_label("Advice").select_option("inspect by")
    page.get_by_role("button", name="Show").click()
    page.wait_for_url("**advice=inspect+by**")
    assert page.locator(ROWS).all_inner_texts() == ["SN-0008", "SN-0003"]
    page.get_by_role("link", name="SN-0003").click()
    assert page.locator("h1").inner_text() == "SN-0003 at 150\u00a0h"


def test_plots_are_drawn_and_can_be_zoomed(opened: Any, address: str) -> None:
    page = opened()
    page.goto(f"{address}/units/2")
    page.wait_for_selector("[data-plot=health] .main-svg")
    page.wait_for_selector("[data-plot=life] .scatterlayer .js-line")
    assert page.locator("figure[data-plot] > [role=img][aria-label]").count() == 3
    assert page.locator("[data-plot=health] .xy, [data-plot=health] .subplot").count() >= 7
    before = shown_hours(page)
    surface = page.locator("[data-plot=life] .nsewdrag").first
    surface.scroll_into_view_if_needed()
    box = surface.bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 50)
    page.mouse.down()
    page.mouse.move(box["x"] + 300, box["y"] + 120, steps=4)
    page.mouse.up()
    page.wait_for_timeout(500)
    assert shown_hours(page) < 0.9 * before


def shown_hours(page: "Page") -> float:
    """Return the range of hours that the plot of the risk of failure shows."""
    first, last = page.evaluate("document.querySelector('[data-plot=life] .zoom').layout.xaxis.range")
    return float(last - first)


def test_without_scripts_pages_show_figures_as_svg_tall_enough_on_a_phone(opened: Any, address: str) -> None:
    page = opened(scripts=False, viewport=NARROW)
    answers = []
    page.on("response", lambda answer: answers.append((answer.status, answer.url)))
    page.goto(f"{address}/units/2")
    for image in page.locator("figure img").all():
        image.scroll_into_view_if_needed()
        assert image.get_attribute("alt")
    page.wait_for_load_state("networkidle")
    assert sum(url.split("?")[0].endswith(".svg") for _, url in answers) == 3
    assert {status for status, _ in answers} == {200}
    box = page.locator("figure[data-plot=health] img").bounding_box()
    assert box["height"] > 2 * box["width"]  # the components are arranged in one column


def test_text_has_enough_contrast_and_fits_wide_and_narrow_screens(opened: Any, address: str) -> None:
    page = opened()
    for path in ("/", "/units/3", "/diagnoses/18", "/upload", "/events", "/data"):
        page.set_viewport_size(NARROW)
        page.goto(address + path)
        for viewport in (NARROW, WIDE):
            page.set_viewport_size(viewport)
            assert page.evaluate(CONTRAST) == [], path
            assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"], path


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of a worn actuator."""
    # The switching model, as in a drive: a recording of the averaged model needs repeated searches.
    recorded = simulate(
        Actuator.thesis(), Chirp(duration=0.2), faults=Faults(friction=0.3), duration=0.2, noise=0.05
    )
    file = tmp_path_factory.mktemp("flight") / "flight.csv"
    # With fewer channels, a diagnosis takes half the time.
    kept = Recording({name: recorded[name] for name in ("time_s", "command_rad", "current_A")})
    write_recording(kept, file)
    return file


def test_a_valid_and_a_broken_recording_can_be_uploaded(
    opened: Any, address: str, flight: Path, tmp_path: Path
) -> None:
    page = opened(scripts=False)
    upload(page, address, flight, "SN-0003")
    page.wait_for_selector(
        "#state:has-text('Degraded'), #state:has-text('explained'), #state:has-text('found')"
    )
    page.get_by_role("link", name="The diagnosis").click()
    assert page.locator("h1").inner_text() == "flight.csv"
    with page.expect_download() as waiting:
        page.get_by_role("link", name="Download the report").click()
    assert "<h1>flight.csv</h1>" in Path(waiting.value.path()).read_text(encoding="utf-8")

    broken = tmp_path / "broken.csv"
    broken.write_text("time_s,command_rad\n0,0\n0.1,x\n")
    upload(page, address, broken, "SN-0003")
    page.wait_for_selector("#state:has-text('Refused')")
    assert "broken.csv" in page.locator("section").inner_text()
    assert str(tmp_path) not in page.content()
    assert "uploads" not in page.locator("section").inner_text()


def upload(page: "Page", address: str, file: Path, unit: str) -> None:
    """Upload a recording with the form."""
    page.goto(f"{address}/upload?unit={unit}")
    page.get_by_label("Recording", exact=True).set_input_files(file)
    page.get_by_label("Flight hours").fill("400")
    page.get_by_role("button", name="Upload").click()
    page.wait_for_url("**/jobs/*")


@pytest.fixture(scope="module")
def guarded(filled: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, str]]:
    """Yield the address of a server that requires a token, and the token."""
    folder = tmp_path_factory.mktemp("guarded")
    file = folder / "fleet.sqlite"
    file.write_bytes(filled.read_bytes())
    token = add_token(folder / "tokens", "alice")
    with served(file, read_tokens(folder / "tokens"), SMALL) as url:
        yield url, token


def test_a_browser_logs_in_with_a_token_and_logs_out(opened: Any, guarded: tuple[str, str]) -> None:
    url, token = guarded
    page = opened()
    page.goto(url)
    assert page.url.endswith("/login")
    page.get_by_label("Token").fill(token)
    page.get_by_role("button", name="Log in").click()
    assert page.locator("h1").inner_text() == "Fleet"
    page.get_by_role("button", name="Log out").click()
    page.goto(f"{url}/units/2")
    assert page.url.endswith("/login")
    page.close()  # before the server ends, else a request for the icon may fail


def test_a_browser_with_a_wrong_token_is_refused(browser: "Browser", guarded: tuple[str, str]) -> None:
    url, _ = guarded
    page = browser.new_page()
    page.goto(url)
    page.get_by_label("Token").fill("nonsense")
    page.get_by_role("button", name="Log in").click()
    assert "not known" in page.locator("main").inner_text()
    page.goto(url)
    assert page.url.endswith("/login")
    page.close()
