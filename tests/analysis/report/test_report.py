import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.report.page import (
    ReportContext,
    ReportTable,
    page_of,
    render_page,
    write_first_sections,
    write_report,
)
from analysis.report.page_model import cell_text, number_columns
from analysis.report.pictures import Picture
from analysis.report.results import compute_results
from analysis.report.section import ReportSection
from analysis.report.sections.paper.curves import caption_gp
from analysis.report.sections.paper.errors import (
    draw_cross_bars,
    draw_cross_map,
    draw_errors,
)
from analysis.report.sections.paper.excerpts import busiest_window, draw_excerpts
from analysis.report.sections.paper.surfaces import near_samples
from analysis.report.sections.paper.table_one import table_one
from analysis.report.sections.paper.tustin_model import draw_tustin_model
from analysis.report.sections.provenance import settings_table
from analysis.report.sections.summary.section import summary, verdicts
from analysis.report.style import render, styled
from analysis.report.velocity_panels import panels
from analysis.study.fits import to_fits
from analysis.study.models import GP_SE, FitOptions
from analysis.study.store import write_atomic
from analysis.study.study import StudyOptions, run_study

pytestmark = pytest.mark.slow  # a whole study and its page

OPTIONS = StudyOptions(fit=FitOptions(gp_points=80), n_jobs=1)
HOSTILE = "<script>$x_1</b>&"


class Page(HTMLParser):
    """Parses every tag with its attributes, and the text in between."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.text = [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text += data

    def attributes(self, tag):
        return [attrs for name, attrs in self.tags if name == tag]


def context(**changes):
    choices = {
        "title": "Traction",
        "subtitle": "three terrains",
        "is_simulated": False,
        "is_foreign": False,
        "generated_utc": "2027-03-14 10:00 UTC",
    }
    return ReportContext(**(choices | changes))


WARMTH = ReportTable(
    "Warmth", ("terrain", "deg C"), [["S0", "21"]], section=ReportSection.HEALTH
)


@pytest.fixture(scope="module")
def written(small_study, tmp_path_factory):
    folder = tmp_path_factory.mktemp("out")
    table = ReportTable("Sessions", ("session", "kept"), [["S012", "10"]], "remark")
    path = write_report(
        small_study, folder, context(is_simulated=True, tables=[table], with_pdf=True)
    )
    return folder, path, Page(path.read_text())


def headings(page):
    return re.findall("<h2>(.*?)</h2>", page.read_text())


def test_the_first_sections_can_be_opened_before_the_others(small_study, tmp_path):
    results = compute_results(small_study)
    shown = write_first_sections(results, tmp_path, context(tables=[WARMTH]))
    page = page_of(tmp_path)
    undone = "Analyses that were not completed"
    first = ["Summary", "The paper&#39;s table and figures", undone]
    assert headings(page) == first
    assert "Warmth" not in page.read_text()  # a table of a later section
    assert "This page is incomplete" in page.read_text()
    assert {f.stem for f in (tmp_path / "figures").iterdir()} == {
        figure.picture.key for figure in shown
    }
    whole = context(results=results, tables=[WARMTH])
    assert write_report(small_study, tmp_path, whole, shown) == page
    text = page.read_text()
    assert "incomplete" not in text
    assert "Warmth" in text
    assert text == write_report(small_study, tmp_path / "whole", whole).read_text()


def test_the_page_needs_no_external_resource(written):
    _, path, page = written
    text = path.read_text()
    assert "http:" not in text
    assert "https:" not in text
    assert not any(attrs.get("src") for attrs in page.attributes("script"))
    assert not page.attributes("link")
    for attrs in page.attributes("img"):
        assert attrs["src"].startswith("data:image/png;base64,")
        assert len(attrs["alt"]) > 20
        assert 100 < int(attrs["width"]) < 1200
    for attrs in page.attributes("a"):
        assert attrs["href"].startswith(("#", "../figures/"))


def test_three_figures_are_drawings_with_stated_axes(written):
    _, _, page = written
    labels = [a["aria-label"] for a in page.attributes("div") if "aria-label" in a]
    drawings = [a for a in page.attributes("svg") if "data-axes" in a]
    assert len(drawings) == 3
    assert len([label for label in labels if len(label) > 20]) >= 3
    for attrs in drawings:
        _, _, width, height = map(float, attrs["viewbox"].split())
        for ax in json.loads(attrs["data-axes"]):
            left, top, right, bottom = ax["box"]
            assert 0.0 <= left < right <= width
            assert 0.0 <= top < bottom <= height
            assert ax["x"][0] < ax["x"][1]
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(ids) == len(set(ids))


def test_numbers_are_aligned_and_have_true_minus_signs():
    table = ReportTable(
        "a", ("name", "x", "y", "z"), [["S-1", "-1.5 ± 0.1", "none", "–"]] * 2
    )
    assert number_columns(table) == [False, True, False, False]
    shown = cell_text("-1.5 ± 0.1; S-1, 2026-11-23, 1e-3, (-.5 to -2)")
    assert shown == (
        "\u22121.5\u00a0±\u00a00.1; S-1, 2026-11-23, 1e-3, (\u2212.5 to \u22122)"
    )


def test_every_link_to_a_pdf_leads_to_one(written):
    _, path, page = written
    links = [a["href"] for a in page.attributes("a") if a["href"].endswith(".pdf")]
    assert len(links) > 10
    for link in links:
        assert (path.parent / link).is_file()


def test_page_shows_the_papers_figures_and_table(written):
    _, _, page = written
    for name in ("Table I", *(f"Fig. {number}" for number in range(4, 11))):
        assert name in page.text
    assert "paper, Table I" in page.text


def test_the_page_is_marked_simulated_and_has_further_tables(written):
    _, _, page = written
    assert "SIMULATED" in page.text
    assert "LIVE" not in page.text
    assert "S012" in page.text
    assert "remark" in page.text


def test_every_number_and_figure_is_saved_with_the_page(written, small_study):
    folder, path, _ = written
    assert path == folder / "report" / "index.html"
    fits = json.loads((folder / "fits.json").read_text())
    assert {key: fits[key] for key in to_fits(small_study)} == to_fits(small_study)
    assert fits["tables"][0]["rows"] == [["S012", "10"]]
    assert (folder / "fits.csv").read_text().startswith("terrain,model,fold")
    shown = len(Page(path.read_text()).attributes("figure"))
    figures = sorted(file.suffix for file in (folder / "figures").iterdir())
    assert figures == [".pdf"] * shown + [".png"] * shown
    for file in (folder / "figures").iterdir():
        start = b"%PDF" if file.suffix == ".pdf" else b"\x89PNG"
        assert file.read_bytes().startswith(start)


def test_a_report_without_pdfs_removes_earlier_ones(small_study, tmp_path, monkeypatch):
    def drawn(key, *_, with_pdf, **__):
        return Picture(key, b"png", b"pdf" if with_pdf else b"")

    monkeypatch.setattr("analysis.report.style.render", drawn)
    write_report(small_study, tmp_path, context(with_pdf=True))
    figures = tmp_path / "figures"
    assert {file.suffix for file in figures.iterdir()} == {".pdf", ".png"}
    for name in ("rig.png", "notes.pdf"):  # a removed figure, and a user's file
        (figures / name).write_bytes(b"x")
    page = Page(write_report(small_study, tmp_path, context()).read_text())
    assert [file.name for file in figures.glob("*.pdf")] == ["notes.pdf"]
    assert not (figures / "rig.png").exists()
    links = [a["href"] for a in page.attributes("a") if "/figures/" in a["href"]]
    assert len(links) > 10
    for link in links:
        assert link.endswith(".png")
        assert (tmp_path / "report" / link).is_file()


@pytest.fixture(scope="module")
def hostile_study(make_series, moving):
    trials = {
        name: [make_series(moving, terrain=name, seed=k) for k in range(2)]
        for name in (HOSTILE, "TF")
    }
    return run_study(trials, OPTIONS, simulated=False)


def test_markup_in_names_stays_text(hostile_study):
    page = Page(render_page(compute_results(hostile_study), [], context(title=HOSTILE)))
    assert page.attributes("script") == [{}]  # the script of the page
    assert page.text.count(HOSTILE) > 3
    assert "LIVE" in page.text


@pytest.mark.parametrize("draw", [draw_excerpts, draw_errors, draw_cross_map])
def test_mathematics_in_names_stays_text(hostile_study, draw):
    from matplotlib.text import Text

    with styled():
        figure = draw(compute_results(hostile_study))
        figure.draw_without_rendering()
    texts = [text.get_text() for text in figure.findobj(Text)]
    assert any(r"<script>\$x_1</b>&" in text for text in texts)


def test_markup_in_a_drawing_stays_text(hostile_study):
    with styled():
        figure = draw_excerpts(compute_results(hostile_study))
        picture = render("drawn", figure, is_simulated=False, is_vector=True)
    page = Page(picture.svg)
    assert page.attributes("script") == []
    assert "<script>" in page.text


def test_a_study_without_models_still_has_a_report(make_series, moving, tmp_path):
    study = run_study({"S0": [make_series(moving)]}, StudyOptions(), simulated=False)
    page = Page(write_report(study, tmp_path, context(is_foreign=True)).read_text())
    assert "Analyses that were not completed" in page.text
    assert "FOREIGN" in page.text
    drawn = [a.get("aria-label", "") for a in page.attributes("div")]
    assert any("velocity below" in alt for alt in drawn)  # Fig. 4 needs no model
    assert not any("Bars of mean absolute error" in alt for alt in drawn)


def test_a_study_without_kept_samples_still_has_a_report(make_series, tmp_path):
    still = [make_series(np.zeros(500), seed=k) for k in range(2)]
    study = run_study({"S0": still}, StudyOptions(), simulated=False)
    page = Page(write_report(study, tmp_path, context()).read_text())
    assert "No figure could be drawn" in page.text


def test_figures_are_reproducible_except_for_the_watermark(small_study):
    results = compute_results(small_study)
    with styled():
        first, second, unmarked = (
            render("a", draw_errors(results), is_simulated)
            for is_simulated in (True, True, False)
        )
    assert first == second
    assert first.png != unmarked.png


def test_the_excerpt_contains_slips_if_there_are_any(small_study):
    assert len(busiest_window(small_study.terrains["S0"]).slips) >= 2
    assert len(busiest_window(small_study.terrains["TF"]).slips) == 0


def test_the_excerpt_contains_bounce_backs_if_there_are_any(small_study):
    for name in ("S0", "B0"):
        result = small_study.terrains[name]
        largest = max(sum(s.has_bounce for s in trial) for trial in result.slips)
        shown = sum(slip.has_bounce for slip in busiest_window(result).slips)
        assert largest >= 1
        assert shown >= 1


def test_bars_across_terrains_show_the_error_over_trials(small_study):
    errors = small_study.cross_errors(GP_SE)
    foreign = [
        e for f in small_study.terrains["S0"].folds for e in f.models[GP_SE].cross["TF"]
    ]
    assert errors["S0"]["TF"] == pytest.approx(np.std(foreign, ddof=1) / 3**0.5)
    own = small_study.terrains["TF"].maes(GP_SE)
    assert errors["TF"]["TF"] == pytest.approx(np.std(own, ddof=1) / 3**0.5)
    with styled():
        figure = draw_cross_bars(compute_results(small_study))
    whiskers = [c for c in figure.axes[0].containers if hasattr(c, "has_yerr")]
    assert len(whiskers) == 3


def test_figure_2_names_the_parameters_of_the_fit_of_all_trials(small_study):
    results = compute_results(small_study)
    with styled():
        figure = draw_tustin_model(results)
    for ax, name in zip(figure.axes, ("S0", "B0", "TF"), strict=False):
        parameters = small_study.terrains[name].whole.fit.parameters
        assert f"= {parameters.mu:.3g}" in ax.texts[0].get_text()
        assert f"= {parameters.b:.3g} kg/s" in ax.texts[0].get_text()
        assert ax.get_ylim()[0] <= 0.0


def test_cells_without_samples_are_faded():
    counts = np.zeros((5, 6))
    counts[1, 1] = 3
    near = near_samples(counts)
    assert near[:3, :3].all()
    assert near.sum() == 9


def test_a_band_below_zero_is_stated(small_study):
    results = compute_results(small_study)
    lowest = {
        p.terrain: float((p.means[1] - 2 * p.sds[1]).min())
        for p in panels(small_study, GP_SE)
    }
    stated = caption_gp(results).partition("below zero")[2]
    assert min(lowest.values()) < 0
    for name, low in lowest.items():
        assert (f"{name} (" in stated) == (low < 0)


def test_the_summary_counts_kept_samples(small_study):
    row = dict(
        zip(summary(small_study).header, summary(small_study).rows[0], strict=True)
    )
    assert row["terrain"] == "S0"
    assert row["kept samples"] == str(745 + 704 + 552)
    assert row["slips"] == "15"


def test_the_papers_row_is_shown_for_comparison(small_study):
    rows = {(row[0], row[1]): row for row in table_one(small_study).rows}
    assert rows["TF", "paper, Table I"][2:7] == [
        "0.843",
        "0.534",
        "0.079",
        "420",
        "7.49",
    ]
    assert ("B0", "this study") in rows


def test_a_median_on_a_search_bound_is_an_inequality(small_study):
    bounds = small_study.options.fit.bounds
    for row in table_one(small_study).rows:
        if row[1] == "this study" and row[4].endswith(f"{bounds.v_s[0]:g}"):
            assert row[4] == f"≤ {bounds.v_s[0]:g}"
    assert any("≤" in cell for row in table_one(small_study).rows for cell in row[2:7])


def test_an_uninformative_model_is_labelled_so(make_series, moving):
    rng = np.random.default_rng(0)
    trials = [make_series(moving, terrain="noise", seed=k) for k in range(3)]
    for series in trials:
        object.__setattr__(series, "F_t", rng.normal(3.0, 1.0, series.t.size))
    study = run_study({"noise": trials}, OPTIONS, simulated=False)
    assert "no model beats a constant" in verdicts(study)[0]


def test_a_useful_model_is_labelled_so(small_study):
    assert "of a constant's" in next(v for v in verdicts(small_study) if v[:2] == "TF")


def test_choices_state_smoothing_in_time_and_in_samples(small_study):
    rows = dict(settings_table(small_study, is_foreign=True).rows)
    assert "22 ms" in rows["smoothing"]
    assert "11 samples" in rows["smoothing"]
    assert "10 ms" in rows["downsampling"]


def test_a_folder_that_cannot_be_written_is_refused(small_study, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    with pytest.raises(SettingsError, match="cannot be written"):
        write_report(small_study, blocked, context())


def test_a_failed_write_keeps_the_old_file_and_no_remains(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    write_atomic(path, b"old")

    def fail(_descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", fail)
    with pytest.raises(SettingsError, match="No space left"):
        write_atomic(path, b"new")
    assert path.read_bytes() == b"old"
    assert [file.name for file in tmp_path.iterdir()] == ["a.txt"]
