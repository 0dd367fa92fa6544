"""The Python interface: the recipes of its page run as they stand, and say what is true."""

import re
from pathlib import Path

import pytest

import femupdate
from femupdate.errors import BuildingError, MeasurementError

PAGE = Path(__file__).resolve().parent.parent / "docs" / "how-to" / "python.md"


def test_the_recipes_run_and_a_softened_story_is_found(tmp_path, monkeypatch, capsys):
    from femupdate.building.files import load_building
    from femupdate.simulation.simulate import (
        SimulationSettings,
        simulate_observation,
        write_simulation,
    )

    monkeypatch.chdir(tmp_path)
    building = load_building("shear_3dof")
    for seed, (name, second) in enumerate({"before": 1.1, "after": 0.99}.items()):
        settings = SimulationSettings(
            theta=(0.9, second, 1.0),
            duration_s=60.0,
            sampling_hz=100.0,
            band_hz=(0.3, 30.0),
            seed=seed,
        )
        write_simulation(simulate_observation(building, settings), Path(f"{name}.csv"))
    rows = [f"{0.02 * k:.2f},{0.3 * (-1) ** (k // 20)}" for k in range(400)]
    Path("quake.csv").write_text("\n".join(["time_s,base", *rows]), encoding="utf-8")
    code = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    names: dict[str, object] = {}
    for block in code:
        exec(block, names)
    assert names["change"].named == ("theta_2",)
    assert names["report"].diagnosis.verdict == "none"
    assert "Roof: " in capsys.readouterr().out


def test_what_is_wrong_is_said_at_once(tmp_path):
    with pytest.raises(BuildingError, match="no_such_building"):
        femupdate.Building.load("no_such_building", study=tmp_path / "new")
    with pytest.raises(MeasurementError, match="no such file"):
        femupdate.Observation.read(tmp_path / "missing.csv")
    assert not (tmp_path / "new").exists()
    with pytest.raises(AttributeError, match="no attribute 'calibrated'"):
        _ = femupdate.calibrated


def test_the_page_shows_every_public_name():
    text = PAGE.read_text(encoding="utf-8")
    assert [name for name in femupdate._INTERFACE if f"femupdate.{name}" not in text] == []
