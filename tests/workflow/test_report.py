"""The page of a study, as text and in a real browser where there is one."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from femupdate.cli.main import group

from femupdate.building import load_building
from femupdate.dynamics import CutMember, MemberForces, Statistics
from femupdate.errors import ReportError, StudyError
from femupdate.inference import load_posterior
from femupdate.report import save_figure
from femupdate.report.figure import new_figure
from femupdate.report.quantities import member_tables, quantities, tidy_table
from femupdate.result import Result
from femupdate.study import Study, file_hash, write_text
from femupdate.workflow import study_status, write_report
from tests.helpers import write_record

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


def rows_of(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def folder(tower_study, tower_observation, tmp_path_factory):
    """Tables that `predict` and `render` write into a study, and the answer of `predict`."""
    import json
    import shutil

    from femupdate.measurement import GroundMotion

    study = shutil.copytree(tower_study, tmp_path_factory.mktemp("tables") / "study")
    histories = tower_observation.histories
    motion = GroundMotion(histories.acceleration[0][:1000], histories.time_step)
    record = write_record(study.parent / "record.csv", motion)
    words = ["predict", "--record", record, "--samples", 20, "--no-pictures", "--json"]
    words.append("--floor-spectra")
    done = CliRunner().invoke(group, [*map(str, words), "--study", str(study)])
    answer = json.loads(done.stdout)
    assert answer["tables"] == [str(study / "tables" / name) for name in PREDICTED]
    return study, answer


@pytest.mark.parametrize(("shear", "units"), [(0.6, ["N", "N/mm"]), (6e4, ["kN", "kN/mm"])])
def test_units_suit_bench_top_models_and_buildings(tower_file, shear, units):
    one = np.full((4, 2), shear)
    found = quantities(load_building(tower_file), ("low", "high"), [one] * 4, 9)
    assert [found[key].unit for key in ("base", "stiffness")] == units
    newton = {"N": 1.0, "kN": 1e3}[units[0]]
    assert found["base"].values[0, 0] * newton == pytest.approx(shear)
    assert found["stiffness"].values[0, 0] * newton * 1e3 == pytest.approx(shear)


PREDICTED = ("predicted_peaks.csv", "floor_spectra.csv", "floor_histories.csv")


def test_predicted_peaks(folder):
    study, answer = folder
    rows = rows_of(study / "tables" / "predicted_peaks.csv")
    assert [row["place"] for row in rows if row["quantity"] == "peak drift"] == ["low", "high"]
    by_key = {(row["quantity"], row["place"]): row for row in rows}
    stiffness = answer["story_stiffness_n_per_m"]["1"]["mean"]
    kept = by_key["stiffness", "low"]
    assert kept["unit"] == "kN/mm"
    assert float(kept["mean"]) == pytest.approx(stiffness / 1e6)
    base, first = by_key["peak base shear", "base"], by_key["peak shear", "low"]
    # Sums of a column alone and beside others are rounded otherwise.
    assert float(base["mean"]) == pytest.approx(float(first["mean"]), rel=1e-12)
    # All masses of the tower but none of its base: 5 t.
    weight = 100.0 * float(base["mean"]) / float(by_key[SHARE]["mean"])
    assert weight == pytest.approx(5.0 * 9.80665, rel=1e-6)
    assert [one["mean"] for one in answer["peaks"]] == [float(row["mean"]) for row in rows]


SHARE = ("peak base shear over weight", "base")


@pytest.fixture
def members():
    """A wall and a beam whose forces are known."""
    wall = CutMember("wall", "X2:S1", np.zeros((2, 3)), ("N", "V", "M"), 0)
    beam = CutMember("beam", "(1, 0, 2.7) to (1.2, 0, 2.7) m", np.zeros((2, 3)), ("N_start",), 0)
    found = []
    for member, size in ((wall, [5514.0, 32320.0, 40940.0]), (beam, [80.69])):
        mean = np.array(size)
        peak = Statistics(mean, 0.01 * mean, 0.98 * mean, 1.02 * mean)
        found.append(MemberForces(member, mean[:, None], 0.0 * mean[:, None], peak))
    return found


def test_largest_forces_of_members_have_one_unit_each(members):
    head, rows = tidy_table("peaks", [], members).sheet()
    assert [row[:3] for row in rows] == [
        ("largest N", "kN", "wall 1, X2:S1"),
        ("largest V", "kN", "wall 1, X2:S1"),
        ("largest M", "kN m", "wall 1, X2:S1"),
        ("largest N start", "kN", "beam 2, (1, 0, 2.7) to (1.2, 0, 2.7) m"),
    ]
    assert rows[1][3:] == pytest.approx((32.32, 0.3232, 31.6736, 32.9664))
    assert len(rows[0]) == len(head)


class Members(Result):
    """Forces of members alone."""

    def __init__(self, members):
        self.members = members

    def items(self):
        return member_tables(self.members)


def test_largest_forces_of_members_are_told_without_exponents(members):
    text = "\n".join(Members(members).lines())
    assert "wall 1, X2:S1: largest forces\n" in text
    assert "  V, kN    32.32 [31.67, 32.97]\n" in text
    assert "e+0" not in text


def test_the_posterior_and_its_responses(calibrated, tower_observation, tower_file):
    words = ["calibrate", tower_observation.path, "--exact", "--particles", 200, "--no-pictures"]
    done = CliRunner().invoke(group, [*map(str, words), "--study", str(calibrated)])
    assert done.exit_code == 0, done.output
    assert "story high" in " ".join(done.stdout.split())
    rows = rows_of(calibrated / "tables" / "posterior.csv")
    assert [row["of"] for row in rows] == ["story low", "story high", "damping ratio"]
    draws = load_posterior(calibrated / "posterior.nc").samples
    assert [float(row["mean"]) for row in rows[:2]] == pytest.approx(draws.mean(axis=0).tolist())
    fit = rows_of(calibrated / "tables" / "frf_fit.csv")
    assert {row["floor"] for row in fit} == {"2F", "RF"}
    used = [row for row in fit if row["used"] == "1"]
    ratio = [float(row["predicted_abs_h"]) / float(row["measured_abs_h"]) for row in used]
    assert np.median(np.abs(np.log(ratio))) < 0.1
