"""The page of a study, as text and in a real browser where there is one."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from femupdate.errors import ReportError, StudyError
from femupdate.report import save_figure
from femupdate.report.figure import new_figure
from femupdate.study import Study, file_hash, write_text
from femupdate.workflow import study_status, write_report

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def study(tower_study, tower_observation, tmp_path_factory):
    """A study of the tower with a prediction and hostile texts."""
    from femupdate.workflow import PredictionSettings, RecordSource, open_study, predict_study

    folder = Path(shutil.copytree(tower_study, tmp_path_factory.mktemp("page") / "study"))
    made = Study(folder)
    record = folder.parent / "record <b>.csv"
    histories = tower_observation.histories
    base = histories.acceleration[0][:1500]
    rows = np.column_stack([histories.time_step * np.arange(len(base)), base])
    np.savetxt(record, rows, delimiter=",", header="time_s,base", comments="")
    predict_study(
        made, open_study(made), RecordSource(record, "m/s2"), PredictionSettings(samples=20)
    )
    kept = json.loads(made.path("posterior_summary.json").read_text(encoding="utf-8"))
    kept["notes"].append("A note with <i>markup</i>: something is missing in the model.")
    write_text(made.path("posterior_summary.json"), json.dumps(kept))
    return made


@pytest.fixture(scope="module")
def written(study, tmp_path_factory):
    return write_report(study, tmp_path_factory.mktemp("page") / "page.html")


def test_the_page_has_every_section_and_is_small(written):
    assert written.sections[0] == "In short"
    assert {"Posterior", "Prediction", "How it was made"} <= set(written.sections)
    assert written.bytes < 8e6
    assert written.stale == ()


def test_the_page_says_what_the_study_holds(written, study):
    html = written.report.read_text(encoding="utf-8")
    assert study.artefacts()["posterior"].sha256[:16] in html
    assert "story high" in html
    assert file_hash(study.path("building.toml"))[:16] in html
    assert "A note with &lt;i&gt;markup&lt;/i&gt;" in html
    assert "record &lt;b&gt;.csv" in html
    assert "peak base shear over weight, %" in html
    for words in ("What is assumed", "damping, law", "share of the mass", "counter(page)"):
        assert words in html
    assert "prefers-color-scheme" in html
    # The tower's file gives no heights.
    assert "drift ratio" not in html


def test_the_first_section_has_verdict_figures_and_the_model(written):
    html = written.report.read_text(encoding="utf-8")
    first = html[html.index('id="summary"') : html.index('id="building"')]
    places = [first.index(part) for part in ("Verdict:", 'alt="model"', "nothing of", "Stiffness")]
    assert places == sorted(places)
    assert "stiffness, kN/mm" in first


@pytest.fixture
def bare(tmp_path, tower_file):
    """A study of a building alone."""
    from femupdate.workflow import open_study

    made = Study(tmp_path / "bare")
    open_study(made, str(tower_file))
    return made


def test_a_client_has_title_names_logo_and_own_sections(bare, tmp_path):
    logo = tmp_path / "logo.png"
    save_figure(new_figure(0.5, 0.3), logo)
    text = tmp_path / "site.md"
    text.write_text(
        "# On <site>\n\nTwo **walls**\nwere removed.\n\n- A crack\n- A door\n", encoding="utf-8"
    )
    report = write_report(
        bare,
        tmp_path / "page.html",
        title='A "tower" <1>',
        author="Jo",
        client="The city",
        logo=logo,
        add=[text, logo],
    )
    html = report.report.read_text(encoding="utf-8")
    assert report.sections[-3:] == ("On <site>", "logo", "How it was made")
    assert "<p>Two walls were removed.</p>" in html
    assert "<li>A crack</li>" in html
    assert "Client: The city</p>" in html
    assert "Author: Jo" in html
    assert '@top-left { content: "A \\22 tower\\22  \\3c 1\\3e "; }' in html
    assert html.count('alt="Logo"') == 1


@pytest.mark.parametrize(("name", "how"), [("a.pdf", "add"), ("a.txt", "logo")])
def test_what_cannot_stand_on_the_page_is_refused(bare, tmp_path, name, how):
    path = tmp_path / name
    path.write_text("%PDF", encoding="utf-8")
    with pytest.raises(ReportError, match=r"a\.(pdf|txt) (cannot stand|is no picture)"):
        write_report(bare, tmp_path / "page.html", **{how: [path] if how == "add" else path})
    assert not (tmp_path / "page.html").exists()


def test_something_stale_is_told_on_the_page(study, tmp_path):
    copy = Study(shutil.copytree(study.folder, tmp_path / "copy"))
    entries = json.loads(copy.path("study.json").read_text(encoding="utf-8"))
    entries["artefacts"]["prediction"]["made_from"]["posterior"] = "older"
    write_text(copy.path("study.json"), json.dumps(entries))
    report = write_report(copy)
    assert report.report == copy.path("report.html")
    assert report.stale == ("prediction: stale",)
    html, glance = " ".join(report.report.read_text("utf-8").split()), study_status(copy)
    # The page begins with what a glance at the study tells, in this order.
    assert glance.stale[0].startswith("The prediction is stale: the posterior changed since")
    places = [html.index(line.partition("`")[0]) for line in (*glance.stale, *glance.first)]
    assert len(places) == 3
    assert sorted(places) == places


def test_a_study_without_a_posterior_has_a_page_too(bare):
    html = write_report(bare).report.read_text(encoding="utf-8")
    assert "Nothing was calibrated yet." in html
    # A client reads no commands.
    assert not [name for name in ("posterior", "prediction", "finder") if f'id="{name}"' in html]
    assert not [words for words in ("<code>femupdate", "All figures hold") if words in html]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("diagnosis.json", '{"verdict": "named"}'),
        ("diagnosis.json", "[[1, 2, 3]]"),
        ("diagnosis.json", '{"verdict": '),
        ("repair.json", '{"rounds": [{"effect": "brace"}], "verdict": "none"}'),
        ("repair.json", '{"rounds": 7}'),
    ],
)
def test_what_another_version_wrote_is_refused(name, text, bare):
    write_text(bare.path(name), text)
    with pytest.raises(StudyError, match=rf"{name} is not what femupdate writes there"):
        write_report(bare)
    assert not bare.result("report.html").exists()


@pytest.fixture(scope="module")
def browser():
    """Headless Chromium by Playwright's client."""
    api = pytest.importorskip("playwright.sync_api", reason="Playwright's client is not installed")
    if CHROMIUM is None:
        pytest.skip("there is no Chromium on this machine")
    with api.sync_playwright() as driver:
        running = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield running
        running.close()


def test_the_page_works_in_a_browser(browser, written):
    """Opened from disk at two widths: no error, no request, a model that moves, tables as CSV."""
    page = browser.new_page(viewport={"width": 390, "height": 900})
    page.set_default_timeout(240_000)  # ms: software rendering on a busy machine
    wrong, asked = [], []
    page.on("console", lambda one: wrong.append(one.text) if one.type == "error" else None)
    page.on("pageerror", lambda one: wrong.append(str(one)))
    page.on("request", lambda one: asked.append(one.url))
    page.goto(written.report.as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    # Type of 9 pt is 13.75 px as drawn: 8 px are left to read.
    shrunk = "[...document.images].map(i => i.getBoundingClientRect().width / i.naturalWidth)"
    assert min(page.evaluate(shrunk)) > 0.58
    page.set_viewport_size({"width": 1280, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280

    canvas = page.locator("figure.scene canvas")
    canvas.scroll_into_view_if_needed()
    still = page.locator("figure.scene canvas").screenshot()
    page.locator("select.modes").select_option("0")
    page.wait_for_timeout(250)
    assert canvas.screenshot() != still
    colors = "c => new Set(c.getContext('2d').getImageData(0, 0, c.width, c.height).data).size"
    assert canvas.evaluate(colors) > 50

    table = page.locator("figure.table", has_text="Parameters").first
    with page.expect_download() as waiting:
        table.locator("button.csv").click()
    text = Path(waiting.value.path()).read_text(encoding="utf-8-sig")
    assert text.startswith("parameter,mean,sd")
    assert "story high" in text

    picture = page.locator("figure.picture").first
    page.locator("[data-tool=close]").click()
    assert not picture.is_visible()
    page.locator("[data-tool=open]").click()
    assert picture.is_visible()
    assert wrong == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
    page.close()
