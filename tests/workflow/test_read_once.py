"""A measured file is read once; what is done with it goes by one content."""

import shutil

import numpy as np
import pytest

from femupdate.errors import MeasurementError
from femupdate.study import Study, file_hash
from femupdate.workflow import (
    CalibrationSettings,
    ObservationSource,
    calibrate_study,
    measured_of,
    open_study,
    readable,
    record_levels,
    study_status,
)


@pytest.fixture
def path(tower_observation, tmp_path):
    return shutil.copy(tower_observation.path, tmp_path / "run.csv")


def test_a_file_that_changes_on_the_way_changes_nothing(path, tower_model):
    building, source = tower_model.building, ObservationSource(path).opened()
    before = measured_of(building, ObservationSource(path), apart=True)
    levels = record_levels(tower_model, source)
    origin = source.made_from()
    assert origin == {"observation": file_hash(path)}
    path.write_text("time_s,base,2F,RF\n0,1,2,3\n", encoding="utf-8")
    after = measured_of(building, source, apart=True)
    whole, again = (before.base, *before.base.halves), (after.base, *after.base.halves)
    for own, other in zip(whole, again, strict=True):
        assert np.array_equal(own.log_frf, other.log_frf, equal_nan=True)
    assert record_levels(tower_model, source) == levels
    assert source.made_from() == source.opened().made_from() == origin
    with pytest.raises(MeasurementError):
        measured_of(building, ObservationSource(path))


def test_a_gap_that_was_filled_is_told_wherever_a_record_is_used(path, tower_model):
    lines = path.read_text(encoding="utf-8").splitlines()
    held = [f"{a.rpartition(',')[0]},{lines[-1000].rpartition(',')[2]}" for a in lines[-1000:-500]]
    path.write_text("\n".join([*lines[:-1000], *held, *lines[-500:]]), encoding="utf-8")
    (told,) = measured_of(tower_model.building, ObservationSource(path)).doubts
    assert "RF: it stands still from" in told


def test_a_posterior_of_a_file_that_has_changed_meanwhile_is_stale(path, tower_file, tmp_path):
    """Its hash is of what was read, not of what lay there at the end."""
    study, source = Study(tmp_path / "study"), readable(Study(tmp_path), {}, path)
    path.write_text("another\n", encoding="utf-8")
    settings = CalibrationSettings(particles=200, exact=True)
    calibrate_study(study, open_study(study, str(tower_file)), source, settings)
    (posterior,) = (one for one in study_status(study).holds if one.name == "posterior")
    assert (posterior.state, posterior.reason) == ("stale", "the file run.csv changed since")


def test_unit_and_columns_are_kept_with_a_file(path, tmp_path):
    study = Study(tmp_path / "study")
    how = {"unit": "m/s2", "columns": {"base": "RF", "RF": "base"}}
    source = ObservationSource(path, **how)
    study.folder.mkdir()
    study.path("p.nc").touch()
    study.record("posterior", "p.nc", "calibrate", source.made_from(), source.files_as_settings())
    again = readable(study, {"unit": None, "columns": None}, path)
    assert {"unit": again.unit, "columns": again.columns} == how
    assert readable(study, {"columns": {}}, path).columns == {}
