"""Good files of every kind, to be mutated."""

import io
import zipfile
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from femupdate.benchmarks.mesh_export import GROUPS, TAGS, export_mesh

from femupdate.building.files import load_building
from femupdate.building.mesh import mesh_building
from femupdate.building.shipped import building_text
from femupdate.measurement.write import write_observation_histories
from femupdate.simulation.simulate import SimulationSettings, simulate_observation
from femupdate.study import Study
from femupdate.surrogate.dataset import DatasetPlan, compute_dataset
from femupdate.workflow.calibrate import calibrate_study
from femupdate.workflow.calibrate_settings import CalibrationSettings
from femupdate.workflow.model import open_study
from femupdate.workflow.observed import ObservationSource

from . import instruments, written
from .subjects import put

_TOWER = "shear_3dof"
_FRAMES = ("six_story_wall_frame", "two_story_openings", "six_story_members")
_STUDY_FILES = ("study.json", "building.toml", "reduced_model.npz", "posterior.nc")

# One wall of four shells on a story, with a column beside it.
_INP = """\
*HEADING
*NODE
1, 0.0, 0.0, 0.0
2, 2.0, 0.0, 0.0
3, 4.0, 0.0, 0.0
4, 0.0, 0.0, 3.0
5, 2.0, 0.0, 3.0
6, 4.0, 0.0, 3.0
*ELEMENT, TYPE=S4, ELSET=wall
1, 1, 2, 5, 4
*ELEMENT, TYPE=B31, ELSET=column
2, 3, 6
*ELEMENT, TYPE=B31, ELSET=beam
3, 5, 6
"""
_MODES = """\
# identified from ambient vibration
mode,frequency_hz,frequency_sd_hz,damping (%),damping_sd (%),2F,3F,RF,RF_sd
1,1.75,0.01,1.0,0.2,0.35,0.7,-1,0.02
2,5.03,,1.3,,-0.98,0.1,,
3,7.70,-,,n/a,0.1,0.4,0.6,0.03
"""
_OWN = """\
name = "own"
kind = "mesh"

[mesh]
file = "{file}"
unit = "m"
{tags}

[[stories]]
name = "S1"
height = "3 m"

[materials.concrete]
youngs_modulus = "30 GPa"
poisson_ratio = 0.2
density = "2400 kg/m3"

[sections.bar]
shape = "rectangle"
width = "300 mm"
depth = "400 mm"

[[parts]]
group = "{wall}"
thickness = "200 mm"

[[parts]]
group = "{column}"
section = "bar"

[[parts]]
group = "{beam}"
section = "bar"

[sensors]
direction = "x"
points = [["2 m", "0 m"]]

[frequency_grid]
start = "0.1 Hz"
step = "0.1 Hz"
count = 100

[prior.theta]
lower = 0.5
upper = 2

[damping]
law = "constant"
ratio = 0.02
"""


def write_seeds(folder: Path) -> None:
    """Write good files of all subjects, a folder each, into a folder of the subject's name."""
    _buildings(folder / "building")
    _meshes(folder / "mesh")
    observation = _observations(folder / "observation")
    _kinds(folder / "kinds")
    _records(folder / "record")
    put(folder / "mapping" / "0", "m.toml", {"m.toml": instruments.MAPPING})
    ambient = {"ambient.csv": instruments.ambient_text()}
    put(folder / "ambient" / "0", "ambient.csv", ambient)
    for kind in ("observation", "kinds", "record"):
        for path in sorted((folder / kind).iterdir()):
            target = (path / "target.txt").read_text(encoding="utf-8")
            put(folder / "inspect" / f"{kind}-{path.name}", target, {target: path / target})
    with_weights = files("femupdate.models") / f"{_TOWER}.safetensors"
    put(folder / "weights" / "0", "w.safetensors", {"w.safetensors": with_weights.read_bytes()})
    _studies(folder, observation)


def _buildings(folder: Path) -> None:
    for name in (_TOWER, *_FRAMES):
        put(folder / name, "b.toml", {"b.toml": building_text(name)[1]})
    own = _OWN.format(file="wall.inp", tags="", wall="wall", column="column", beam="beam")
    put(folder / "own", "own.toml", {"own.toml": own, "wall.inp": _INP})


def _meshes(folder: Path) -> None:
    names = {name: name for name in ("wall", "column", "beam")}
    own = _OWN.format(file="wall.inp", tags="", **names)
    put(folder / "inp", "wall.inp", {"own.toml": own, "wall.inp": _INP})
    mesh = mesh_building(load_building(folder / "inp" / "own.toml"))
    for ending in ("vtu", "msh", "med"):
        path = export_mesh(mesh, folder.parent / f"wall.{ending}")
        numbered = ending == "vtu"
        groups = {name: str(1 + GROUPS.index(name)) for name in names} if numbered else names
        tags = f'tags = "{TAGS}"' if numbered else ""
        own = _OWN.format(file=path.name, tags=tags, **groups)
        put(folder / ending, path.name, {"own.toml": own, path.name: path})
        path.unlink()


def _observations(folder: Path) -> Path:
    tower = building_text(_TOWER)[1]
    settings = SimulationSettings(duration_s=20.0, sampling_hz=50.0, band_hz=(0.3, 20.0), seed=3)
    histories = simulate_observation(load_building(_TOWER), settings).histories
    path = write_observation_histories(folder.parent / "obs.csv", histories, (), 6)
    text = path.read_text(encoding="utf-8")
    decimal = text.replace(",", ";").replace(".", ",")
    rows = {c.floor: row for c, row in zip(histories.channels, histories.acceleration, strict=True)}
    few = {name: rows[name] for name in ("base", "RF")}
    arrays = {"fs": 1.0 / histories.time_step, "unit": "m/s2", **few}
    frequency = 0.25 * np.arange(1, 60)
    h = 1.0 / (1.0 - (frequency / 3.0) ** 2 + 0.1j * frequency)
    amplitude = "\n".join(f"{f:g},{abs(x):.5g},0.1" for f, x in zip(frequency, h, strict=True))
    both = "\n".join(f"{f:g},{x.real:.5g},{x.imag:.5g}" for f, x in zip(frequency, h, strict=True))
    contents: dict[str, bytes | str] = {
        "histories.csv": text,
        "decimal.csv": decimal,
        "amplitude.csv": f"frequency_hz,RF,RF_sd\n{amplitude}\n",
        "complex.csv": f"frequency_hz,RF_re,RF_im\n{both}\n",
        "arrays.npz": _npz(arrays),
        "arrays.mat": _mat(arrays),
        "station.zip": _zip({f"{k}.asc": _esm(rows[k]) for k in ("base", "RF")}),
    }
    for name, content in contents.items():
        put(folder / name, name, {"tower.toml": tower, name: content})
    return path


def _kinds(folder: Path) -> None:
    """What calibrate takes beside histories and response functions over the base."""
    tower = building_text(_TOWER)[1]
    folder.mkdir(parents=True)
    contents: dict[str, bytes | str] = {
        "modes.csv": _MODES,
        "modes.npz": _npz(instruments.mode_arrays()),
        "modes.mat": _mat(instruments.mode_arrays()),
        **instruments.universal_files(folder),
        **instruments.force_texts(),
        "run.tdms": instruments.tdms_file(),
    }
    for name, content in contents.items():
        put(folder / name, name, {"tower.toml": tower, name: content})


def _npz(arrays: dict[str, Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _mat(arrays: dict[str, Any]) -> bytes:
    from scipy.io import savemat

    buffer = io.BytesIO()
    savemat(buffer, arrays)
    return buffer.getvalue()


def _zip(members: dict[str, str]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in members.items():
            archive.writestr(name, text)
    return buffer.getvalue()


def _esm(values: np.ndarray) -> str:
    return written.esm_text([float(v) for v in 100.0 * values])


def _records(folder: Path) -> None:
    folder.mkdir(parents=True)
    time = np.arange(300) * 0.02
    wave = [float(v) for v in np.round(90 * np.exp(-time) * np.sin(9 * time + 0.4) - 2 * time, 3)]
    rows = "\n".join(f"{t:.2f},{v}" for t, v in zip(time, wave, strict=True))
    knet = written.knet_text([round(100 * v) for v in wave], "3.00")
    esm = written.esm_text(wave)
    texts: dict[str, bytes | str] = {
        "plain.csv": f"time_s,EW\ns,gal\n{rows}\n",
        "jma.csv": written.jma_text({"NS": wave, "EW": wave[::-1]}),
        "peer.at2": written.peer_text([v / 981.0 for v in wave]),
        "csmip.v1": written.csmip_v1_text({"90 Deg": [v / 981.0 for v in wave]}),
        "csmip.v2": written.csmip_v2_text(wave),
        "knet.EW": knet,
        "kiknet.EW2": instruments.kiknet_text(knet),
        "esm.asc": esm,
        "cosmos.v2": written.cosmos_text({"90 deg, Roof - center": wave}),
        "smc.smc": written.smc_text(wave),
        "run.tdms": instruments.tdms_file(),
        **instruments.seismic_files(folder),
    }
    for name, text in texts.items():
        put(folder / name, name, {name: text})
    put(folder / "archive.zip", "archive.zip", {"archive.zip": _zip({"a.asc": esm})})


def _studies(folder: Path, observation: Path) -> None:
    study = Study(folder.parent / "study")
    model = open_study(study, _TOWER)
    settings = CalibrationSettings(particles=200)
    calibrate_study(study, model, ObservationSource(observation), settings)
    whole = {name: study.path(name) for name in _STUDY_FILES}
    posterior = {"posterior.nc": study.path("posterior.nc")}
    put(folder / "posterior" / "0", "posterior.nc", posterior)
    put(folder / "study record" / "0", "study.json", whole)
    put(folder / "reduced model" / "0", "reduced_model.npz", whole)
    shards = folder.parent / "shards"
    top = float(model.frequency_hz[-1])
    compute_dataset(model.system, model.prior, DatasetPlan(100, 3, top, 1), shards)
    put(folder / "data set" / "0", "0000.npz", {"0000.npz": shards / "0000.npz"})
