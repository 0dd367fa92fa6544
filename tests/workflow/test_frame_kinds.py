"""What is hidden in modes and in a hammer test of a frame, the two-story cabin."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eigh

from femupdate.discrepancy import (
    FinderModel,
    MeshError,
    judged_by_mesh,
    plain_structure,
    prepared,
    sought,
)
from femupdate.dynamics import equations_at
from femupdate.effects import CATALOGUE
from femupdate.progress import SILENT
from femupdate.workflow import ObservationSource, open_study
from femupdate.workflow.kinds import read_measured_of
from femupdate.workflow.likelihoods import data_of

THETA, ZETA, MASS = np.array([0.9, 1.2]), 0.03, 0.3
GRID = np.arange(1.0, 20.0, 0.2)


@pytest.fixture(scope="module")
def cabin(cabin_built):
    model = open_study(cabin_built)
    plain = plain_structure(model.building, model.reduced)
    finder = FinderModel(model.building, plain, plain.structure)
    return SimpleNamespace(study=cabin_built, model=model, finder=finder)


def _modes(structure, mass):
    """Circular frequencies (r,), floors' shapes (f, r) and what the base moves (r,)."""
    added = CATALOGUE["added_mass"].terms(structure, "RF")
    own = equations_at(structure, THETA, [(added, mass)])
    squared, vectors = eigh(own.stiffness.toarray(), own.mass.toarray())
    return np.sqrt(squared), structure.floor_rows @ vectors, vectors.T @ own.force[:, 0]


def _identified(path, structure, hidden):
    """The three modes along the motion, with errors of .2 % and .01; hidden is a turned sensor."""
    (omega, shapes, moved), rng = _modes(structure, 0.0), np.random.default_rng(4)
    shapes = np.array([[-1.0], [1.0]]) * shapes if hidden else shapes
    rows = ["frequency_hz,frequency_sd_hz,2F,RF,2F_sd,RF_sd"]
    for k in np.sort(np.argsort(-np.abs(moved))[:3]):
        shape = shapes[:, k] / np.abs(shapes[:, k]).max() + 0.01 * rng.standard_normal(2)
        hertz = omega[k] / (2.0 * np.pi) * np.exp(0.002 * rng.standard_normal())
        rows.append(",".join(map(str, (hertz, 0.002 * hertz, *shape, 0.01, 0.01))))
    path.write_text("\n".join(rows) + "\n")


def _hit(path, structure, hidden):
    """Accelerance under a hammer on the roof, with errors of .05; hidden is a mass there."""
    omega, shapes, _ = _modes(structure, MASS if hidden else 0.0)
    w = 2.0 * np.pi * GRID[:, None]
    modes = -(w**2) / (omega**2 - w**2 + 2j * ZETA * omega * w)
    values = np.abs(modes @ (shapes * shapes[-1]).T)
    values *= np.exp(0.05 * np.random.default_rng(4).standard_normal(values.shape))
    rows = [f"{f},{a},{b},0.05,0.05" for f, (a, b) in zip(GRID, values, strict=True)]
    head = "frequency_hz,2F/RF (m/s2/N),RF/RF (m/s2/N),2F/RF_sd,RF/RF_sd"
    path.write_text("\n".join([head, *rows]) + "\n")


def _found(cabin, path):
    given = read_measured_of(cabin.study, cabin.model, _source(path), SILENT, True)
    posed = prepared(cabin.finder, data_of(given, cabin.model.system))
    return sought(cabin.finder, *posed)[1]


def _source(path):
    return ObservationSource(path, mode_error=0.002)


def test_nothing_is_found_where_nothing_is_hidden(cabin, tmp_path):
    _identified(tmp_path / "seen.csv", cabin.finder.structure, False)
    assert _found(cabin, tmp_path / "seen.csv").verdict == "none"


def test_added_mass_shows_in_a_hammer_test(cabin, tmp_path):
    _hit(tmp_path / "seen.csv", cabin.finder.structure, True)
    found = _found(cabin, tmp_path / "seen.csv")
    assert (found.verdict, found.leading.placed.label) == ("named", "added_mass@RF")
    assert abs(found.leading.size - MASS) < 3.0 * found.leading.size_sd + 0.02
    fine, coarse = (MeshError((), (), (), 0.0, 0.0, 0.0, moved=moved) for moved in (0.02, 0.05))
    assert judged_by_mesh(found, fine) is found
    refused = judged_by_mesh(found, coarse)
    assert (refused.verdict, refused.sentence.count("split = 1")) == ("unknown", 1)
