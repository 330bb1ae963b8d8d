"""The report is readable in headless Chromium, on the screen and in print."""

import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

from analysis.report.page import html_page, write_report
from analysis.report.page_model import PageSection, ReportContext, ReportFigure
from analysis.report.section import ReportSection, ReportTable
from analysis.report.style import new_figure, render, styled
from analysis.study.models import GP_SE_NOISE, PAPER_MODELS, FitOptions
from analysis.study.study import StudyOptions, run_study
from analysis.tables.loading import load_tables

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))),
    None,
)
pytestmark = [
    pytest.mark.browser,
    pytest.mark.timeout(900),
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine"),
]
WIDTHS = (1600, 800, 500)  # from a desktop to the narrowest possible window
_BROWSER = "not an origin"
PROBE = """<script>
addEventListener("load", () => {
  const images = [...document.images];
  document.title = "probe " + JSON.stringify({
    figures: document.querySelectorAll("figure").length,
    broken: images.filter(image => !image.complete || image.naturalWidth < 300).length
      + [...document.querySelectorAll(".drawing svg")].filter(
        drawing => drawing.getBoundingClientRect().height < 100).length,
    without_text: images.filter(image => image.alt.length < 20).length
      + [...document.querySelectorAll(".drawing")].filter(
        drawing => drawing.getAttribute("aria-label").length < 20).length,
    overflow: document.documentElement.scrollWidth - innerWidth,
    dead: [...document.querySelectorAll("nav a")].filter(
      link => !document.querySelector(link.getAttribute("href"))).length,
  });
});
</script>"""

SUMMARY = """<script>
addEventListener("load", () => {
  const table = document.querySelector("#summary [aria-label='Samples and errors']");
  document.title = "probe " + JSON.stringify({
    hidden: table.scrollWidth - table.clientWidth,
    columns: table.querySelectorAll("thead th").length,
  });
});
</script>"""

USE = """<script>
addEventListener("load", () => {
  const column = () => [...document.querySelectorAll("tbody tr")].map(
    row => row.cells[1].textContent);
  const result = { buttons: document.querySelectorAll("thead button").length };
  document.querySelectorAll("thead button")[1].click();
  result.up = column();
  document.querySelectorAll("thead button")[1].click();
  result.down = column();
  const svg = document.querySelector(".drawing svg"), box = svg.getBoundingClientRect();
  const point = (kind, x, y) => svg.dispatchEvent(new PointerEvent(kind, {
    clientX: box.left + x * box.width, clientY: box.top + y * box.height,
    pointerId: 1, pointerType: "mouse", bubbles: true }));
  svg.setPointerCapture = () => {};
  result.whole = svg.getAttribute("viewBox");
  point("pointermove", 0.5, 0.5);
  result.readout = document.querySelector(".readout").textContent;
  point("pointerdown", 0.4, 0.4);
  point("pointermove", 0.6, 0.6);
  point("pointerup", 0.6, 0.6);
  result.part = svg.getAttribute("viewBox");
  svg.dispatchEvent(new MouseEvent("dblclick"));
  result.again = svg.getAttribute("viewBox");
  document.title = "probe " + JSON.stringify(result);
});
</script>"""


@dataclass(frozen=True)
class Opened:
    """Output of a browser for a page, and the addresses that the page requested."""

    out: str
    console: list[str]
    urls: set[str]


def open_page(page: Path, folder: Path, *options: str) -> Opened:
    """Open a page headless and return its events."""
    log = folder / "net.json"
    command = [
        *(CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run"),
        *("--disable-background-networking", "--disable-component-update"),
        *("--disable-sync", "--disable-default-apps", "--enable-logging=stderr"),
        "--host-resolver-rules=MAP * ~NOTFOUND",
        *(f"--user-data-dir={folder / 'profile'}", f"--log-net-log={log}"),
        *("--hide-scrollbars", *options, page.as_uri()),
    ]
    done = subprocess.run(command, capture_output=True, check=True, timeout=300)
    lines = done.stderr.decode(errors="replace").splitlines()
    params = [
        event.get("params", {}) for event in json.loads(log.read_text())["events"]
    ]
    # requests by the browser itself have no page as origin
    urls = {
        p["url"]
        for p in params
        if "url" in p and p.get("initiator", _BROWSER) != _BROWSER
    }
    return Opened(
        done.stdout.decode(), [line for line in lines if "CONSOLE" in line], urls
    )


def probe(page: Path, folder: Path, width: int, script: str = PROBE) -> dict:
    """Return the result of a script run in a copy of the page."""
    copy = folder / "probe.html"
    copy.write_text(page.read_text().replace("</body>", script + "</body>"))
    opened = open_page(copy, folder, f"--window-size={width},2000", "--dump-dom")
    result = re.search(r"<title>probe (.*?)</title>", opened.out)
    assert result is not None, opened.out[:500]
    return json.loads(result.group(1).replace("&quot;", '"'))


def assert_readable(page: Path, folder: Path, least: int) -> None:
    """Require a page without overflow, requests or errors, also in print."""
    for width in WIDTHS:
        result = probe(page, folder, width)
        assert result.pop("figures") >= least
        assert result.pop("overflow") <= 0
        assert set(result.values()) == {0}, result
    picture, printed = folder / "page.png", folder / "page.pdf"
    screen = open_page(
        page, folder, "--window-size=1200,12000", f"--screenshot={picture}"
    )
    paper = open_page(
        page, folder, "--no-pdf-header-footer", f"--print-to-pdf={printed}"
    )
    for opened in (screen, paper):
        assert opened.console == []
        assert opened.urls == set()
    assert picture.stat().st_size > 100_000
    pages = len(re.findall(rb"/Type\s*/Page\b", printed.read_bytes()))
    assert pages > least // 3


def written(study, folder: Path) -> Path:
    context = ReportContext(
        title="Traction study",
        subtitle="trials on stones and plates",
        is_simulated=study.simulated,
        is_foreign=False,
        generated_utc="2027-03-14T10:00:00Z",
    )
    return write_report(study, folder / "out", context)


def test_a_report_is_readable_on_screen_and_paper(small_study, tmp_path):
    assert_readable(written(small_study, tmp_path), tmp_path, least=16)


def test_the_summary_fits_a_small_screen(small_study, tmp_path):
    result = probe(written(small_study, tmp_path), tmp_path, 1280, SUMMARY)
    assert result == {"hidden": 0, "columns": 12}


def small_page(folder: Path) -> Path:
    """Write a page of one table and one drawing."""
    cells = ("10 ± 1", "-2", "–", "≤ 0.5")
    table = ReportTable("a", ("name", "x"), [(f"S{k}", x) for k, x in enumerate(cells)])
    with styled():
        figure = new_figure(3.0)
        ax = figure.subplots()
        ax.plot([0.0, 4.0], [-1.0, 1.0])
        drawn = render("drawn", figure, is_simulated=True, is_vector=True)
    shown = ReportFigure(ReportSection.BEYOND, "A line", "A line " * 5, "", drawn)
    section = PageSection(ReportSection.BEYOND, (), [table], [shown])
    context = ReportContext("Traction", "", True, False, "2027-03-14T10:00:00Z")
    page = folder / "small.html"
    page.write_text(html_page(context, [section], []))
    return page


def test_a_table_is_sorted_and_a_drawing_is_read_and_enlarged(tmp_path):
    result = probe(small_page(tmp_path), tmp_path, 1200, USE)
    assert result["buttons"] == 2
    assert result["up"] == ["\u22122", "≤ 0.5", "10&nbsp;±&nbsp;1", "–"]
    assert result["down"] == result["up"][::-1]
    x, y = map(
        float, re.findall(r"[xy] (\S+)", result["readout"].replace("\u2212", "-"))
    )
    assert 1.5 < x < 2.5
    assert abs(y) < 0.3
    whole, part = (list(map(float, result[k].split())) for k in ("whole", "part"))
    assert part[2] == pytest.approx(0.2 * whole[2], rel=0.02)
    assert part[3] == pytest.approx(0.2 * whole[3], rel=0.02)
    assert result["again"] == result["whole"]


def test_a_page_with_requests_or_errors_is_detected(tmp_path):
    page = tmp_path / "asks.html"
    page.write_text(
        '<body><img src="http://127.0.0.1:9/a.png">'
        '<script>console.error("alas")</script></body>'
    )
    opened = open_page(page, tmp_path, "--dump-dom")
    assert opened.urls == {"http://127.0.0.1:9/a.png"}
    assert "alas" in opened.console[0]


@pytest.mark.long
@pytest.mark.shared_data
def test_the_report_of_a_whole_study_is_readable(shared_data, tmp_path):
    trials = load_tables([shared_data / "rehearsal_trials.npz"])
    options = StudyOptions(fit=FitOptions(models=(*PAPER_MODELS, GP_SE_NOISE)))
    study = run_study(trials, options, simulated=True)
    assert_readable(written(study, tmp_path), tmp_path, least=18)
