"""A fixed set of commands, each with the figures that are taken from its JSON.

Only the command line with --json is used, so that the internals may change. The observations of
sticks are made without femupdate, those of other buildings by `simulate`. Needs Linux (/proc).
"""

import json
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..usage import measure
from . import sticks

# Figures by name, under the kind that says how they are compared (compare.RULES).
Figures = dict[str, dict[str, Any]]
Content = dict[str, Any]

ROOT = Path(__file__).resolve().parents[3]
MAIN = "from femupdate.cli.main import main; main()"
SHIPPED = "six_story_white_noise.csv"
SIX = "six_story_wall_frame"
DRAWS = 2000  # of predictions


@dataclass(frozen=True)
class Run:
    """One command."""

    name: str  # in the record
    arguments: tuple[str, ...]  # of femupdate
    read: Callable[[Content], Figures]  # takes the figures from its JSON
    limit_s: float = 600.0  # processor seconds after which it is stopped
    writes: Path | None = None  # file that must not be there before


def read_model(content: Content) -> Figures:
    """Frequencies and sizes of a building."""
    frequencies = {f"frequency {k} Hz": v for k, v in enumerate(content["frequencies_hz"], 1)}
    same = {"degrees of freedom": content["dof"], "elements": content["elements"]}
    shown = {name: content[name] for name in ("reduced_size", "reduction_error")}
    return {"digits": frequencies, "same": same, "shown": shown}


def read_posterior(content: Content) -> Figures:
    """Means, standard deviations and evidence."""
    rows = zip(content["parameters"], content["mean"], content["sd"], strict=True)
    posterior = {name: [mean, sd] for name, mean, sd in rows}
    if "zeta" in content:
        posterior["zeta"] = [content["zeta"]["mean"], content["zeta"]["sd"]]
    figures: Figures = {"posterior": posterior}
    if "log_evidence" in content:
        pair = [content["log_evidence"], content["log_evidence_error"]]
        figures["evidence"] = {"log evidence": pair}
    figures["shown"] = {
        "misfit": content["misfit"],
        "evaluations": content["evaluations"],
        "largest r-hat": max((v for v in content["r_hat"] or () if v is not None), default=None),
    }
    solutions = sorted(content["identifiability"].get("modes", []), key=lambda one: one["mean"])
    for k, one in enumerate(solutions, 1):
        figures["shown"][f"weight of solution {k}"] = one["weight"]
    return figures


def read_prediction(content: Content) -> Figures:
    """Peaks of the floors: mean and the ends of their 90 % interval."""
    peaks = content["peak_acceleration_m_s2"]
    return {
        "interval": {f"peak {f} m/s2": [p["mean"], p["q05"], p["q95"]] for f, p in peaks.items()},
        "shown": {
            f"error {floor}": one["relative_error"]
            for floor, one in content.get("comparison", {}).items()
        },
    }


def read_diagnosis(content: Content) -> Figures:
    """Verdict, and what it names."""
    figures: Figures = {"same": {"verdict": content["verdict"]}}
    shown = {name: content[name] for name in ("chi2", "independent_points", "p_value")}
    figures["shown"] = shown
    if content["effects"]:
        first = content["effects"][0]
        label = f"{first['name']}@{first['place']}"
        shown["log evidence of the first"] = first["log_evidence_over_none"]
        named = content["verdict"] == "named"
        figures["same" if named else "shown"]["first effect"] = label
        if named and first["size_sd"]:
            figures["posterior"] = {f"size of {label}": [first["size"], first["size_sd"]]}
    twins = content["cannot_be_told_from_the_first"]
    figures["same"]["cannot be told from it"] = ", ".join(sorted(twins))
    figures["same"]["cannot be seen"] = ", ".join(sorted(content["cannot_be_seen"]))
    return figures


def read_repair(content: Content) -> Figures:
    """What was added, and the posterior before and after."""
    rounds = content["rounds"]
    added = [f"{one['effect']}@{one['place']}" for one in rounds]
    posterior = {
        f"size of {label}": [one["size"], one["size_sd"]]
        for label, one in zip(added, rounds, strict=True)
        if one["size_sd"]
    }
    for when in ("before", "after"):
        pairs = zip(content[f"theta_{when}"], content[f"theta_sd_{when}"], strict=True)
        posterior |= {f"theta_{k} {when}": list(pair) for k, pair in enumerate(pairs, 1)}
    names = [f"{what}_{when}" for what in ("chi2", "holdout_chi2") for when in ("before", "after")]
    same = {"verdict": content["verdict"], "added": ", ".join(added)}
    shown = {name: content[name] for name in (*names, "holdout_error_after")}
    return {"same": same, "posterior": posterior, "shown": shown}


def read_simulation(content: Content) -> Figures:
    """The truth behind a simulated file, and the rms of its columns."""
    truth = content["truth"]
    table = sticks.read_columns(Path(content["observation"]))
    rms = {f"rms of {name}": value for name, value in table.items()}
    frequencies = {f"frequency {k} Hz": v for k, v in enumerate(truth["frequencies_hz"], 1)}
    return {"digits": frequencies, "shown": rms}


def read_nothing(content: Content) -> Figures:
    """Of a command that counts by its time and memory alone."""
    return {}


@dataclass(frozen=True)
class Folders:
    """Of the studies and of the observations."""

    work: Path
    data: Path

    def ground_motion(self) -> tuple[str, ...]:
        """Options of `predict`."""
        record = ROOT / "examples/records/ridgecrest_2019_clc_90.csv"
        return ("--record", str(record), "--samples", str(DRAWS))

    def observation(self, name: str) -> str:
        """Path of an observation file."""
        return str(self.data / f"{name}.csv")


def make_observations(folder: Path) -> None:
    """Write all observations that need no simulation."""
    last = folder / "six_channel_gain.csv"
    if last.exists():
        return
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "two_story.toml").write_text(sticks.TWO_STORIES, encoding="utf-8")
    for name, theta, changes, seed, rms in sticks.cases():
        sticks.write_histories(folder / f"{name}.csv", theta, changes, seed, rms)
    sticks.write_frf_table(folder / "roof_frf.csv", ("RF",), noise=0.2, seed=101)
    source = ROOT / "examples" / SHIPPED
    shutil.copy(source, folder / "six_clean.csv")
    sticks.scale_floor(source, last, "4F", 1.08)


def all_runs(folders: Folders) -> Iterator[Run]:
    """The runs, cheap ones first; later ones use the studies of earlier ones."""
    yield from (_model(name) for name in ("shear_3dof", "shear_4dof", "two_story_openings"))
    yield from _stick_posteriors(folders)
    yield from _repairs(folders)
    yield from _six_story_posterior(folders)
    yield from _finder_cases(folders)
    yield from _six_story_finder(folders)
    yield _model("twelve_story_core")
    # The usual data set, and one pass over it: memory does not depend on the number of passes.
    train = ("train", "--fresh", "--epochs", "1", "--study", "six_train", "--building", SIX)
    yield Run("six train", train, read_nothing)
    own = ("--exact", "--study", "six_exact", "--building", SIX)
    exact = ("calibrate", folders.observation("six_clean"), *own)
    yield Run("six exact", exact, read_posterior, limit_s=500.0)


def _model(name: str) -> Run:
    return Run(f"model {name}", ("build-model", name, "--study", name), read_model)


def _simulation(folders: Folders, name: str, building: str, *options: str) -> Run:
    """Files of other buildings than the stick, which need femupdate itself."""
    file = folders.work / "data" / f"{name}.csv"
    arguments = ("simulate", "--building", building, "-o", str(file), *options)
    return Run(f"simulate {name}", arguments, read_simulation, writes=file)


def _stick_posteriors(folders: Folders) -> Iterator[Run]:
    truth = ("--theta", "0.8,1.2,1.0", "--zeta", "0.015")
    yield _simulation(folders, "three", "shear_3dof", *truth)
    for building, case in (
        ("shear_4dof", "roof_frf"),
        ("shear_4dof", "clean_0"),
        ("shear_3dof", "three"),
    ):
        for name, exact in (("latent", ()), ("exact", ("--exact",))):
            study = ("--study", f"{case}_{name}")
            options = (*exact, "--building", building, *study)
            calibrate = ("calibrate", folders.observation(case), *options)
            yield Run(f"{case} {name}", calibrate, read_posterior)
        predict = ("predict", *folders.ground_motion(), "--study", f"{case}_exact")
        yield Run(f"{case} predict", predict, read_prediction)


def _repairs(folders: Folders) -> Iterator[Run]:
    """Effects that are added to the model, and what the repaired model says."""
    for name, option in (("mass", ("--holdout",)), ("softer", ())):
        first, second = (folders.observation(f"{name}_{k}") for k in (1, 2))
        options = (*option, second, "--building", "shear_4dof", "--study", name)
        yield Run(f"{name} repair", ("repair", first, *options), read_repair)
        predict = ("predict", *folders.ground_motion(), "--study", f"{name}/repaired")
        yield Run(f"{name} repaired predict", predict, read_prediction)
    again = ("calibrate", folders.observation("mass_2"), "--exact", "--study", "mass/repaired")
    yield Run("mass repaired exact", again, read_posterior)


def _finder_cases(folders: Folders) -> Iterator[Run]:
    """Nothing, one effect, two, none of the catalogue, and twins."""
    two_story = str(folders.data / "two_story.toml")
    usual = ("--building", "shear_4dof", "--study", "shear_4dof")
    studies = {
        "twin": ("--building", two_story, "--study", "two_story"),
        "roof": ("--sensors", "RF", *usual),
    }
    for name in sticks.FINDER:
        kind = name.split("_")[0]
        case = ("diagnose", folders.observation(name), *studies.get(kind, usual))
        yield Run(f"finder {name}", case, read_diagnosis)


def _six_story_posterior(folders: Folders) -> Iterator[Run]:
    yield _model(SIX)
    calibrate = ("calibrate", folders.observation("six_clean"), "--study", SIX)
    yield Run("six latent", calibrate, read_posterior)
    predict = ("predict", *folders.ground_motion(), "--study", SIX)
    yield Run("six predict", predict, read_prediction)
    for command in ("render", "report"):
        yield Run(f"six {command}", (command, "--study", SIX), read_nothing)
    # Of another file, as two posteriors of one are not compared; its roof is the same.
    roof = ("--sensors", "RF", "--name", "roof", "--study", SIX)
    other = folders.observation("six_channel_gain")
    yield Run("six roof", ("calibrate", other, *roof), read_posterior)
    yield Run("six compare", ("compare", "posterior", "roof", "--study", SIX), read_nothing)
    file = folders.observation("six_clean")
    yield Run("six inspect", ("inspect", file), read_nothing)
    modes = ("identify", file, "-o", str(folders.work / "modes.csv"), "--overwrite")
    yield Run("six identify", modes, read_nothing)
    yield Run("six status", ("status", "--study", SIX), read_nothing)


def _six_story_finder(folders: Folders) -> Iterator[Run]:
    truth = ("--theta", "0.9,1.1,1.0,0.8,1.2,1.0", "--zeta", "0.02")
    mass = ("--effect", "added_mass@4F=0.12")
    yield _simulation(folders, "six_added_mass", SIX, *truth, *mass)
    for case in ("six_clean", "six_channel_gain", "six_added_mass"):
        arguments = ("diagnose", folders.observation(case), "--study", SIX)
        yield Run(f"finder {case}", arguments, read_diagnosis, limit_s=1500.0)
    mass_file, clean = (folders.observation(f"six_{name}") for name in ("added_mass", "clean"))
    repair = ("repair", mass_file, "--holdout", clean, "--study", SIX)
    yield Run("six repair", repair, read_repair, limit_s=1500.0)


def record(run: Run, folders: Folders) -> Content:
    """Run a command and return what is kept of it."""
    paths = {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", MAIN, *run.arguments, "--json"]
    log = folders.work / "logs" / run.name.replace(" ", "_")
    if run.writes is not None:
        run.writes.parent.mkdir(exist_ok=True)
        run.writes.unlink(missing_ok=True)
    usage = measure(command, {**os.environ, **paths}, folders.work, log, run.limit_s)
    kept: Content = {
        "status": "finished",
        "seconds": round(usage.seconds, 2),
        "processor_seconds": round(usage.processor_seconds, 2),
        "peak_mb": round(usage.peak_mb),
    }
    if usage.ended is None:
        kept["status"] = "unfinished"
    elif usage.ended:
        lines = Path(f"{log}.err").read_text().strip().splitlines()
        message = lines[-1] if lines else f"exit code {usage.ended}"
        for path in (folders.work, folders.data, ROOT):
            message = message.replace(f"{path}/", "")
        kept["status"] = f"failed: {message}"
    else:
        try:
            kept["figures"] = run.read(json.loads(Path(f"{log}.json").read_text()))
        except (KeyError, ValueError, TypeError) as error:  # a key has another name now
            kept["status"] = f"unreadable: {type(error).__name__} {error}"
    return kept
