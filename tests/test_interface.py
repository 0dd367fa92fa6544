"""The Python interface: the recipes of its page run as they stand, and say what is true."""

import doctest
import io
import re
from pathlib import Path

import numpy as np
import pytest
from click import Context
from femupdate.cli.main import group

import femupdate
from femupdate.errors import BuildingError, FemupdateError, MeasurementError, ReportError
from femupdate.measurement import read_observation_file

PAGE = Path(__file__).resolve().parent.parent / "docs" / "how-to" / "python.md"


def simulated(path, **settings):
    """A measurement of the three-story building."""
    how = {"duration_s": 60.0, "sampling_hz": 100.0, "band_hz": (0.3, 30.0)}
    femupdate.simulate("shear_3dof", path, **how, **settings)


def write_quake(path="quake.csv"):
    rows = [f"{0.02 * k:.2f},{0.3 * (-1) ** (k // 20)}" for k in range(400)]
    Path(path).write_text("\n".join(["time_s,base", *rows]), encoding="utf-8")


@pytest.mark.slow
def test_the_recipes_run_and_a_softened_story_is_found(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for seed, (name, second) in enumerate({"before": 1.1, "after": 0.99}.items()):
        simulated(f"{name}.csv", theta=(0.9, second, 1.0), seed=seed)
    write_quake()
    code = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    names: dict[str, object] = {}
    for block in code:
        exec(block, names)
    assert names["change"].named == ("theta_2",)
    assert names["report"].diagnosis.verdict == "none"
    assert list(names["frame"]["parameter"]) == ["theta_1", "theta_2", "theta_3", "zeta"]
    assert len(names["figure"].axes) > 0
    assert repr(names["found"]).startswith("Verdict: the data are explained (shear_3dof")
    assert re.search("Next: <code>femupdate.*<td>theta_1</td>", names["found"]._repr_html_())
    with pytest.raises(ReportError, match="there is no figure x; known: frf_fit"):
        names["found"].plot("x")
    assert "Roof: " in capsys.readouterr().out


def test_what_is_wrong_is_said_at_once(tmp_path):
    with pytest.raises(BuildingError, match="no_such_building"):
        femupdate.reduce(tmp_path / "new", "no_such_building")
    with pytest.raises(MeasurementError, match="no such file"):
        femupdate.calibrate(tmp_path / "new", tmp_path / "missing.csv", building="shear_3dof")
    assert not (tmp_path / "new").exists()
    with pytest.raises(AttributeError, match="no attribute 'calibrated'"):
        _ = femupdate.calibrated
    with pytest.raises(MeasurementError, match=r"missing\.csv: no such file"):
        femupdate.inspect(tmp_path / "missing.csv")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"band": (1, 2)}, "there is no keyword 'band'; did you mean 'band_hz'"),
        ({"band_hz": "1,12"}, "band_hz='1,12': it should be a valid tuple"),
        ({"band_hz": (12, 1)}, "write the lowest frequency first"),
        ({"particles": 3}, "particles=3: it should be greater than or equal to 200"),
        ({"columns": ["base"]}, r"columns=\['base'\]: it should be a valid dictionary"),
        ({"sensors": "9F"}, "there is no 9F to use"),
    ],
)
def test_a_keyword_that_cannot_be_is_told(given, said, folder):
    with pytest.raises(FemupdateError, match=said):
        femupdate.calibrate(folder / "new", folder / "run.csv", building="shear_3dof", **given)
    assert not (folder / "new").exists()


@pytest.mark.parametrize("data", [(), (3,), (np.zeros((3, 3)),)])
def test_what_is_no_measurement_is_refused(data, folder):
    with pytest.raises(FemupdateError, match="no measure"):
        femupdate.calibrate(folder / "new", *data, building="shear_3dof")


def test_results_and_nouns_fit_a_screen(folder, monkeypatch):
    monkeypatch.chdir(folder)
    model = femupdate.reduce("screen", "shear_3dof")
    told = [model, model.system, model.reduced, femupdate.Study("screen"), model.building]
    told += [femupdate.build_model("screen"), femupdate.inspect("run.csv", "none.csv")]
    assert "Heaviest modes: 3.880 Hz (X)" in repr(told[5])
    told += [
        femupdate.status("screen"),
        read_observation_file("run.csv"),
        femupdate.GroundMotion.from_arrays([0, 1], 0.1),
    ]
    assert all(20 < len(repr(each)) < 1500 for each in told)
    assert "none.csv: no such file" in repr(told[6])


def test_every_command_has_its_verb(tmp_path):
    named = {"build-model": "build_model", "report": "write_report", "list": "catalogue"}
    named["examples"] = "copy_examples"
    verbs = {named.get(name, name) for name in group.list_commands(Context(group))}
    # Benchmarks are of a checkout.
    assert verbs - {"benchmark"} <= {*femupdate.__all__}
    assert femupdate.catalogue().buildings
    assert femupdate.copy_examples(tmp_path / "new").as_dict()


def test_modes_are_identified_and_rendered_as_the_commands_do(folder, monkeypatch):
    monkeypatch.chdir(folder)
    femupdate.calibrate("drawn", "run.csv", building="shear_3dof", exact=True, particles=200)
    rendered = femupdate.render("drawn", modes=2, samples=8)
    assert rendered.to_dataframe().shape[0] == 2
    pytest.importorskip("pyoma2")
    modes = femupdate.identify("run.csv", "modes.csv", order=20)
    assert "femupdate calibrate modes.csv" in repr(modes)


def test_arrays_of_accelerations_are_taken_as_a_file_is(tmp_path):
    truth = {"theta": (0.9, 1.1, 1.0), "zeta": 0.02}
    simulated(tmp_path / "run.csv", **truth)
    read = read_observation_file(tmp_path / "run.csv")
    rows = {c.name: row / 9.80665 for c, row in zip(read.channels, read.acceleration, strict=True)}
    seen = femupdate.Observation.from_accelerations(read.time_step, rows, unit="g")
    how = {"building": "shear_3dof", "exact": True, "particles": 400}
    found = femupdate.calibrate(tmp_path / "house", seen, **how)
    assert np.abs(found.posterior.samples.mean(axis=0) - truth["theta"]).max() < 0.01
    kept = tmp_path / "house" / "measured" / "arrays.csv"
    assert found.files == (kept,)
    again = [held.again for held in femupdate.status(tmp_path / "house").holds]
    assert f"calibrate {kept} --exact --particles 400" in again
    for wrong in ({"base": [1.0], "attic": [2.0]}, {"base": [1.0], "RF": [1.0, 2.0]}):
        with pytest.raises(MeasurementError, match="give base, 2F"):
            femupdate.Observation.from_accelerations(0.01, wrong)


def test_every_public_name_is_told():
    assert {*femupdate.__all__} == {*femupdate._NOUNS, *femupdate._VERBS}
    assert {*femupdate.__all__} <= {*dir(femupdate)}
    assert all(getattr(femupdate, name).__doc__ for name in femupdate.__all__)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the files that examples in docstrings read."""
    folder = tmp_path_factory.mktemp("examples")
    simulated(folder / "run.csv", theta=(0.9, 1.1, 1.0))
    write_quake(folder / "quake.csv")
    return folder


@pytest.mark.parametrize("name", sorted(femupdate._NOUNS))
def test_the_example_of_a_noun_runs(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    noun = getattr(femupdate, name)
    example = doctest.DocTestParser().get_doctest(noun.__doc__, {}, name, None, None)
    assert example.examples
    told = io.StringIO()
    doctest.DocTestRunner().run(example, out=told.write)
    assert told.getvalue() == ""
