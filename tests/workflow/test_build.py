"""build-model against closed forms, and what it does to a study that has something in it."""

import re

import numpy as np
import pytest
from matplotlib.text import Text

from femupdate.dynamics import reduced_modes
from femupdate.errors import StructureError, StudyError
from femupdate.study import Study
from femupdate.workflow import REDUCED, CertifiedModel, build_model, open_study
from tests.helpers import Recorded, snapshot


@pytest.mark.parametrize(
    ("name", "stories", "square"), [("shear_3dof", 3, 3000.0), ("shear_4dof", 4, 1000.0)]
)
def test_frequencies_of_an_even_chain(tmp_path, name, stories, square):
    """w_j = 2 sqrt(k/m) sin((2j - 1) pi / (4n + 2)) (Blevins 1979, table 8-1)."""
    report = build_model(Study(tmp_path), name)
    order = np.arange(1, stories + 1)
    closed = 2 * np.sqrt(square) * np.sin((2 * order - 1) * np.pi / (4 * stories + 2)) / (2 * np.pi)
    # The same equations: rounding alone.
    np.testing.assert_allclose(report.frequencies_hz, closed, rtol=1e-9)
    assert report.effective_mass.sum() == pytest.approx(1.0)
    assert report.effective_mass[0] > 0.8
    assert report.model.reduction_error == 0.0
    assert (report.dof, report.elements, report.mass_kg) == (stories, stories, stories)


@pytest.fixture(scope="module")
def cabin(tmp_path_factory, cabin_file):
    study = Study(tmp_path_factory.mktemp("cabin") / "study")
    log = Recorded()
    return build_model(study, str(cabin_file), progress=log), study, log


def test_a_frame_weighs_what_its_file_says(cabin):
    """40 t a floor in all, self weight included."""
    assert cabin[0].mass_kg == pytest.approx(80e3)
    assert "80.0 t" in " ".join(cabin[0].checks)


def test_the_reduced_model_has_the_modes_of_the_full_one(cabin):
    """Below the top of the grid, 20 Hz, as far as the base motion drives them."""
    report, _, _ = cabin
    full = report.frequencies_hz[(report.effective_mass > 0.01) & (report.frequencies_hz < 20)]
    assert len(full) == 3
    own = reduced_modes(report.model.reduced, np.ones((1, 2))).frequency_hz[0]
    nearest = own[np.abs(own[:, None] - full).argmin(axis=0)]
    # Each mode lies in the span of the basis: 1e-4 of a frequency moves ln|H| by less than .01.
    np.testing.assert_allclose(nearest, full, rtol=1e-4)
    assert report.model.reduction_error <= 0.1
    assert report.model.reduced.size < report.dof


def test_the_mesh_can_be_read_by_others(cabin):
    import meshio

    report, study, _ = cabin
    mesh = meshio.read(study.path("mesh.vtu"))
    count = {block.type: len(block.data) for block in mesh.cells}
    assert count == {"quad": 12, "line": 32}
    assert sum(count.values()) == report.elements
    np.testing.assert_allclose(mesh.points.max(axis=0), [4.0, 5.0, 6.0])
    np.testing.assert_allclose(mesh.points.min(axis=0), 0.0, atol=1e-12)
    story = np.concatenate(mesh.cell_data["story"])
    assert set(story) == {1, 2}
    # The slab of a floor belongs to the story below it: those of story 2 lie at 6 m.
    quads = next(k for k, block in enumerate(mesh.cells) if block.type == "quad")
    height = mesh.points[mesh.cells[quads].data][:, :, 2].max(axis=1)
    assert set(height[mesh.cell_data["story"][quads] == 2]) == {6.0}
    assert set(mesh.cell_data["thickness_m"][quads]) == {0.15, 0.06}


def test_modes_say_what_they_move(cabin):
    """A wall on one side of the plan couples the motion along x with torsion."""
    modes = cabin[0].modes
    assert modes.direction[:4] == ("Y", "X", "torsion", "Y")
    assert modes.effective_mass[0] == pytest.approx([0.0, 0.9], abs=0.02)
    assert modes.effective_mass[2, 0] > 0.05
    assert (modes.effective_mass.sum(axis=0) < 1.0).all()


def test_a_picture_says_what_the_table_says(cabin):
    table = {line[:3].strip(): line.split() for line in repr(cabin[0]).splitlines()}
    texts = " ".join(text.get_text() for text in cabin[0].plot().findobj(Text))
    number, said, share = re.search(r"Mode (\d+) .*: (.*) Hz, (.*) % of the", texts).groups()
    _, hertz, _, expected, *_ = table[number]
    assert (said, share) == (f"{float(hertz):.2f}", expected)


def test_what_cannot_be_reduced_is_told_with_its_modes(tmp_path, cabin_file):
    path = tmp_path / "cabin.toml"
    path.write_text(cabin_file.read_text().replace("tolerance = 0.1", "tolerance = 1e-12"))
    with pytest.raises(StructureError, match=r"or lower .*, below which are \d+ modes \([\d.]+, "):
        build_model(Study(tmp_path / "study"), str(path))


def test_without_a_name_a_study_keeps_its_building(tmp_path, tower_file):
    study = Study(tmp_path)
    build_model(study, str(tower_file))
    assert build_model(study).model.building.name == "tower"


def test_a_posterior_keeps_its_building(tower, tower_file):
    before = snapshot(tower.folder)
    with pytest.raises(StudyError, match="holds a posterior of the building tower; choose"):
        build_model(tower, "shear_3dof")
    assert snapshot(tower.folder) == before
    assert build_model(tower, str(tower_file)).model.building.name == "tower"
    assert tower.path("posterior.nc").exists()


@pytest.mark.parametrize("damage", [lambda data: data[:999], lambda data: b"", None])
def test_a_damaged_reduced_model_is_made_again(cabin_study, damage):
    path = cabin_study.path("reduced_model.npz")
    good = open_study(cabin_study)
    if damage is None:
        path.unlink()
    else:
        path.write_bytes(damage(path.read_bytes()))
    again = open_study(cabin_study)
    np.testing.assert_allclose(again.reduced.excitation, good.reduced.excitation)
    assert again.reduction_error == open_study(cabin_study).reduction_error
    assert again.reduction_error == good.reduction_error


def test_a_reduced_model_reads_back_equal(cabin_study, tmp_path):
    model = open_study(cabin_study).reduced
    study = Study(tmp_path)
    study.keep(REDUCED, {"building": "ab12"}, CertifiedModel(model, 0.0123))
    kept = study.kept(REDUCED, {"building": "ab12"})
    again = kept.model
    assert kept.rms_error == 0.0123
    assert again.floors == model.floors == ("2F", "RF")
    for name in ("stiffness_terms", "stiffness_constant", "excitation", "floor_shapes"):
        np.testing.assert_array_equal(getattr(again, name), getattr(model, name))
    np.testing.assert_array_equal(again.node_shapes, model.node_shapes)
