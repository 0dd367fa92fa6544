"""What is fuzzed: every kind of file that femupdate reads, with good files to start from."""

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from femupdate.study import MANIFEST, Study, file_hash

SEED_FILE = "target.txt"
"""Names the file of a folder that is mutated."""

_BY_NUMBER = {"2F": "1", "3F": "2", "RF": "3"}
_COLUMNS = {
    "modes.npz": _BY_NUMBER,
    "modes.mat": _BY_NUMBER,
    "modes.uff": {"2F": "point 1 +X", "3F": "point 2 +X", "RF": "point 3 +X"},
    "text.uff": {"base": "1", "RF": "2"},
    "binary.uff": {"base": "1", "RF": "2"},
    "run.tdms": {"base": "1", "RF": "2"},
    "frf.uff": {"2F/RF": "1", "RF/RF": "2"},
}
"""Of the good files of many kinds that do not name floors."""

_WITHOUT_UNIT = (".mseed", ".sac", ".sg2")

Read = Callable[[Path], object]


@dataclass(frozen=True)
class Subject:
    """A kind of file.

    Attributes:
        name: of the kind.
        share: of all mutated files.
        read: reads a file as a command would.
    """

    name: str
    share: float
    read: Read


def _building(path: Path) -> object:
    from femupdate.building.document import mechanics_hash, to_document
    from femupdate.building.files import load_building
    from femupdate.building.toml_writer import to_toml

    building = load_building(path)
    return mechanics_hash(building), to_toml(to_document(building))


def _mesh(path: Path) -> object:
    from femupdate.building.files import load_building
    from femupdate.building.mesh import mesh_building
    from femupdate.fe.assembly import assemble

    return assemble(mesh_building(load_building(path.with_name("own.toml"))).model)


def _observation(path: Path) -> object:
    from femupdate.building.files import load_building
    from femupdate.workflow.observed import ObservationSource, observation_of

    named = path.suffix == ".csv" or path.suffix in (".mat", ".npz")
    columns = None if named else {"base": "1", "RF": "2"}
    source = ObservationSource(path, columns=columns)
    return observation_of(load_building(path.with_name("tower.toml")), source)


def _kinds(path: Path) -> object:
    """As calibrate takes whatever it is given."""
    from femupdate.building.files import load_building
    from femupdate.workflow.kinds import measured_of
    from femupdate.workflow.observed import ObservationSource

    columns = _COLUMNS.get(path.name)
    building = load_building(path.with_name("tower.toml"))
    return measured_of(building, ObservationSource(path, columns=columns))


def _mapping(path: Path) -> object:
    from femupdate.measurement.mapping_file import read_mapping

    return read_mapping(path)


def _ambient(path: Path) -> object:
    from femupdate.workflow.identify import identify

    output = path.with_name("modes.csv")
    try:
        return identify(path, output, order=10).lines()
    finally:
        output.unlink(missing_ok=True)


def _record(path: Path) -> object:
    from femupdate.measurement.record import read_record

    return read_record(path, channel=1, unit="gal" if path.suffix in _WITHOUT_UNIT else None)


def _inspected(path: Path) -> object:
    from femupdate.errors import MeasurementError
    from femupdate.workflow.inspect_files import inspect_files

    found = inspect_files([path])
    if found.refused:
        raise MeasurementError(found.refused[0])
    return found.as_dict(), found.lines()


def _weights(path: Path) -> object:
    from femupdate.surrogate.storage import load_surrogate

    return load_surrogate(path)


def _posterior(path: Path) -> object:
    from femupdate.inference.posterior import load_posterior

    return load_posterior(path)


def _status(path: Path) -> object:
    from femupdate.workflow.status import study_status

    return study_status(Study(path.parent)).as_dict()


def _reduced(path: Path) -> object:
    """With the hash that the study's record has."""
    from femupdate.workflow.model import open_study

    manifest = path.with_name(MANIFEST)
    content = json.loads(manifest.read_text(encoding="utf-8"))
    content["artefacts"]["reduced model"]["sha256"] = file_hash(path)
    manifest.write_text(json.dumps(content), encoding="utf-8")
    return open_study(Study(path.parent))


def _dataset(path: Path) -> object:
    import torch

    from femupdate.surrogate.dataset import kept_shard

    return kept_shard(path, torch.zeros(100, 6), 3)


SUBJECTS = (
    Subject("building", 0.2, _building),
    Subject("mesh", 0.15, _mesh),
    Subject("observation", 0.15, _observation),
    Subject("kinds", 0.15, _kinds),
    Subject("mapping", 0.02, _mapping),
    Subject("ambient", 0.02, _ambient),
    Subject("record", 0.15, _record),
    Subject("inspect", 0.1, _inspected),
    Subject("weights", 0.05, _weights),
    Subject("posterior", 0.05, _posterior),
    Subject("study record", 0.04, _status),
    Subject("reduced model", 0.03, _reduced),
    Subject("data set", 0.03, _dataset),
)


def subject(name: str) -> Subject:
    """The subject of a name."""
    return next(one for one in SUBJECTS if one.name == name)


def seed_folders(folder: Path, name: str) -> list[Path]:
    """Folders of the good files of a subject, in order."""
    return sorted((folder / name).iterdir())


def target_of(folder: Path) -> str:
    """Name of the file in a seed's folder that is mutated."""
    return (folder / SEED_FILE).read_text(encoding="utf-8")


def put(folder: Path, target: str, files: Mapping[str, bytes | str | Path]) -> None:
    """Make the folder of a seed.

    Args:
        folder: made here.
        target: which of the files is mutated.
        files: by their names: contents, or files to copy.
    """
    folder.mkdir(parents=True)
    for name, content in files.items():
        if isinstance(content, Path):
            shutil.copyfile(content, folder / name)
        else:
            data = content if isinstance(content, bytes) else content.encode()
            (folder / name).write_bytes(data)
    (folder / SEED_FILE).write_text(target, encoding="utf-8")
