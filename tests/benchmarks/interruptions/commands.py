"""Commands to interrupt, and what each of them leaves behind."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from femupdate.building.shipped import building_text
from femupdate.inference.posterior import load_posterior
from femupdate.surrogate.storage import load_surrogate

SCRIPT = str(Path(sys.executable).with_name("femupdate"))
_BUILDING = "shear_3dof"
_TRAINED = "shear_4dof"  # whose surrogate is shipped
_WEIGHTS_FILE = "surrogate.safetensors"
_FRAME = "two_story_openings"


@dataclass(frozen=True)
class Interruptible:
    """A command that takes some seconds.

    Attributes:
        name: of the command.
        words: its arguments but for the folder.
        result: file of the folder that holds what it found.
        read: digest of that file, without times and paths.
        option: that names the folder.
    """

    name: str
    words: tuple[str, ...]
    result: str
    read: Callable[[Path], str]
    option: str = "--study"

    def call(self, study: Path) -> list[str]:
        """The whole command line."""
        return [SCRIPT, *self.words, self.option, str(study)]

    def digest(self, study: Path) -> str:
        """What the command found."""
        return self.read(study / self.result)


def _posterior(path: Path) -> str:
    draws = load_posterior(path)
    arrays = (draws.theta, draws.zeta, draws.log_likelihood)
    return sha256(b"".join(a.tobytes() for a in arrays if a is not None)).hexdigest()


def _weights(path: Path) -> str:
    state = load_surrogate(path).mvae.state_dict()
    return sha256(b"".join(value.numpy().tobytes() for value in state.values())).hexdigest()


def _findings(path: Path) -> str:
    content = json.loads(path.read_text(encoding="utf-8"))
    for name in ("seconds", "building", "study"):
        content.pop(name, None)
    return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _trials(path: Path) -> str:
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()[1:]]
    for line in lines:
        line["content"].pop("seconds")
    lines.sort(key=lambda line: str(line["key"]))
    return sha256(json.dumps(lines, sort_keys=True).encode()).hexdigest()


def _bytes(path: Path) -> str:
    return sha256(path.read_bytes()).hexdigest()


def interruptible(folder: Path) -> tuple[Interruptible, ...]:
    """The commands, with the files that they need made in a folder."""
    plain, hidden, known = (folder / f"{name}.csv" for name in ("plain", "hidden", "known"))
    common = ("--duration", "60", "--sampling", "50", "--band", "0.3,20", "--seed", "3")
    effect = ("--effect", "added_mass@3F=0.3")
    for path, more in ((plain, ()), (hidden, effect)):
        run([SCRIPT, "simulate", "-o", str(path), "--building", _BUILDING, *common, *more])
    run([SCRIPT, "simulate", "-o", str(known), "--building", _TRAINED, *common])
    frame = folder / "frame.toml"
    text = re.sub(r'(?m)^size = "0.3 m"', 'size = "1 m"', building_text(_FRAME)[1])
    frame.write_text(text, encoding="utf-8")
    build = ("build-model", str(frame))
    quiet, building = ("--no-pictures",), ("--building", _BUILDING)
    sampled = ("--exact", "--particles", "2000")
    shipped = ("calibrate", str(known), "--building", _TRAINED, "--particles", "1000", *quiet)
    trials = ("--clean", "1", "--one", "2", "--two", "0", "--outside", "0")
    training = ("--samples", "5100", "--batch", "128", "--epochs", "2", "--fresh")
    return (
        Interruptible("train", ("train", *building, *training), _WEIGHTS_FILE, _weights),
        Interruptible(
            "train --dask local",
            ("train", *building, *training, "--dask", "local"),
            _WEIGHTS_FILE,
            _weights,
        ),
        Interruptible("calibrate", shipped, "posterior.nc", _posterior),
        Interruptible(
            "calibrate --exact from the surrogate",
            (*shipped, "--exact"),
            "posterior.nc",
            _posterior,
        ),
        Interruptible(
            "calibrate --exact",
            ("calibrate", str(plain), *building, *sampled, *quiet),
            "posterior.nc",
            _posterior,
        ),
        Interruptible(
            "diagnose", ("diagnose", str(hidden), *building, *quiet), "diagnosis.json", _findings
        ),
        Interruptible(
            "repair", ("repair", str(hidden), *building, *quiet), "repair.json", _findings
        ),
        Interruptible("build-model", (*build, *quiet), "reduced_model.npz", _bytes),
        Interruptible(
            "benchmark hidden-effects",
            ("benchmark", "hidden-effects", "--building", _TRAINED, *trials),
            f"hidden_effects_{_TRAINED}.jsonl",
            _trials,
            "--output",
        ),
    )


def run(call: Sequence[str], **options: Any) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, with one thread for the numerical libraries.

    Raises:
        RuntimeError: it fails, where `check` is left out.
    """
    check = options.pop("check", True)
    done = subprocess.run(
        call, capture_output=True, text=True, check=False, env=environment(), **options
    )
    if check and done.returncode != 0:
        raise RuntimeError(f"{' '.join(call)}: {done.stderr.strip()[-500:]}")
    return done


def environment() -> dict[str, str]:
    """Of all commands: results are the same to the last digit for one number of threads."""
    return {**os.environ, "OMP_NUM_THREADS": "1"}
