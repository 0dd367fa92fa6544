"""Fresh cases: what `diagnose` says of buildings that are not shipped, by truths of OpenSees.

    python -m femupdate.benchmarks.missing_effects.fresh FOLDER [PATTERN [SEED]]

Two sticks, two frames and the deck of one of them, which is read back. Cases that the folder has
already are kept; PATTERN, such as `clean-*`, chooses, and another SEED than 0 makes others.
"""

import csv
import json
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import resample_poly

import femupdate
from femupdate.arrays import Floats
from femupdate.building import load_building
from femupdate.fe import bulk_data
from femupdate.simulation import fine_model

from ..result import Job
from . import make
from .entries import KINDS, places_of
from .frames import frame_modes
from .make import EVERY, RATE_HZ, effect, motion, write_hammer, write_modes
from .stick import STEP_S, Stick

SECONDS = 40.0
_HEAD = """
frequency_grid = {start = "0.1 Hz", step = "0.1 Hz", count = 180}
prior = {theta = {lower = "1/3", upper = 3}, zeta = {lower = 0.003, upper = 0.06}}
damping = {law = "constant", ratio = 0.02}
"""
STICKS = {  # masses in t, stiffness in MN/m, heights in m
    "soft4": ([210, 190, 185, 150], [190, 400, 330, 260], [4.5, 3.0, 3.0, 3.0]),
    "steel5": ([420, 400, 395, 390, 300], [900, 820, 700, 560, 380], [5.0, 4, 4, 4, 4]),
}
_FRAME = """kind = "frame"
stories = [{name = "S1", height = "3.6 m"}, {name = "S2", height = "3 m"}]
materials.concrete = {youngs_modulus = "27 GPa", poisson_ratio = 0.2, density = "2400 kg/m3"}
sections.column = {shape = "rectangle", width = "350 mm", depth = "350 mm"}
sections.beam = {shape = "rectangle", width = "250 mm", depth = "450 mm"}
columns = [{section = "column"}]
beams = [{section = "beam"}]
mesh.size = "1 m"
reduction.tolerance = 0.01
"""
FRAMES = {
    "open2": _FRAME + """
grid = {x = {A = "0 m", B = "5 m"}, y = {P = "0 m", Q = "4 m"}}
slabs = [{x = ["A", "B"], y = ["P", "Q"], thickness = "160 mm"}]
sensors = {direction = "x", points = ["A-P", "B-Q"]}
""",
    "wall2": _FRAME + """
grid = {x = {A = "0 m", B = "4 m", C = "9 m"}, y = {P = "0 m", Q = "5 m"}}
walls = [{along = "Q", from = "A", to = "B", thickness = "100 mm"}]
slabs = [{x = ["A", "C"], y = ["P", "Q"], thickness = "150 mm"}]
sensors = {direction = "x", points = ["A-P", "C-Q"]}
""",
}  # fmt: skip
_DECK = """kind = "mesh"
mesh = {file = "deck2.bdf", unit = "m", force = "N", base = "0 m"}
stories = [{name = "S1", height = "3.6 m"}, {name = "S2", height = "3 m"}]
sensors = {direction = "x", points = [["0 m", "0 m"], ["5 m", "4 m"]]}
"""

_ON_STICKS = {
    "clean": 16, "nonlinear": 8, "mass": 3, "damper": 2, "brace": 2, "appendage": 2, "delay": 2,
    "gain": 2, "exchanged": 1, "reversed": 1, "outside": 5, "pair": 4, "several": 2,
    "modes": 10, "hammer": 10,
}  # fmt: skip
# Kind of case, buildings, and how many of each.
PLAN = (
    *((kind, tuple(STICKS), count) for kind, count in _ON_STICKS.items()),
    ("clean", ("open2", "wall2"), 2),
    ("clean", ("deck2",), 4),
    ("mass", ("open2", "wall2"), 2),
    ("mass", ("deck2",), 2),
    ("columns", ("open2", "wall2"), 1),
    ("walls", ("wall2",), 2),
    ("several", ("open2", "wall2"), 1),
)
_NONLINEAR, _OUTSIDE, _SEVERAL = "nonlinear", "outside", ("pair", "several")
# Measured in place of a record: nothing or, of odd numbers, a mass is hidden.
_MEASURED = {"modes": write_modes, "hammer": write_hammer}


def cases() -> Iterator[tuple[str, str, str, int]]:
    """Name, kind, building and seed of every case."""
    for kind, buildings, count in PLAN:
        for building in buildings:
            for number in range(count):
                yield f"{kind}-{building}-{number}", kind, building, number


def write_buildings(folder: Path) -> None:
    """The files of all buildings, and of the sticks as they are known to 2 %."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (mass, stiffness, height) in STICKS.items():
        stories = "".join(
            f'[[stories]]\nname = "S{k}"\nmass = "{m} t"\nstiffness = "{s} MN/m"\n'
            f'height = "{h} m"\n'
            for k, (m, s, h) in enumerate(zip(mass, stiffness, height, strict=True), 1)
        )
        for end, known in (("", ""), ("_2", '[tolerances]\nmass = "2 %"\n')):
            text = f'name = "{name}{end}"\nkind = "shear"\n{_HEAD}{stories}{known}'
            (folder / f"{name}{end}.toml").write_text(text)
    for name, text in {**FRAMES, "deck2": _DECK}.items():
        (folder / f"{name}.toml").write_text(f'name = "{name}"\n{_HEAD}{text}')
    model = fine_model(load_building(folder / "open2.toml"), 1.0, ["A-P", "B-Q"])
    assert model.structure.mesh is not None
    (folder / "deck2.bdf").write_text(bulk_data(model.structure.mesh.model))


def make_case(
    name: str, kind: str, building: str, number: int, folder: Path, seed: int = 0
) -> dict[str, Any]:
    """Write NAME.csv, and return the building's file and what is hidden."""
    rng = np.random.default_rng([*name.encode(), number, seed][: None if seed else -1])
    file, factors = folder / f"{building}.toml", np.exp(rng.uniform(-0.3, 0.3, 5))
    known = load_building(file)
    floors, stories = tuple(known.floors), tuple(known.story_names)
    factors, zeta = factors[: len(floors)], float(np.exp(rng.uniform(np.log(0.006), np.log(0.03))))
    base = motion(str(rng.choice(["quake", "white"])), SECONDS, rng)
    channels: Callable[[Floats], Floats] | None = None
    if building in STICKS:
        mass, stiffness, _ = (np.array(values, dtype=float) for values in STICKS[building])
        stick = Stick(mass=1e3 * mass, stiffness=1e6 * stiffness * factors, zeta=zeta)
        what = kind if kind not in _MEASURED else "mass" if number % 2 else "clean"
        stick, channels, missing, words = _hidden(stick, what, floors, stories, base, rng)
        if kind in _MEASURED:
            _MEASURED[kind](folder / f"{name}.csv", stick, zeta, floors, rng)
            return _case(file, words, missing, factors, zeta)
        if kind == "clean" and number % 2:
            file = folder / f"{building}_2.toml"
        if kind == _NONLINEAR or words == "pounding":
            base = 3.0 * base
        answered = stick.respond(base)
    else:
        members = _of_frame(kind, floors, stories, rng)
        missing = [
            effect(KINDS[what], *(stories if at == "all" else [at]), size=size)
            for what, at, size in members
        ]
        drawn = load_building(folder / f"{'open2' if building == 'deck2' else building}.toml")
        modes = frame_modes(drawn, factors, members, mesh_size=0.35, shell="ASDShellQ4")
        answered, words = modes.respond(zeta, base), kind
    if kind == "clean":
        missing = []
    seen = np.vstack([base, answered])
    seen = seen if channels is None else channels(seen)
    kept = resample_poly(seen, 1, EVERY, axis=1)
    noise = float(rng.choice([0.005, 0.01, 0.02, 0.04])) * kept[0].std()
    kept = kept + noise * rng.standard_normal(kept.shape)
    with (folder / f"{name}.csv").open("w", newline="") as lines:
        writer = csv.writer(lines, lineterminator="\n")
        writer.writerow(["time_s", *(f"{title} (m/s2)" for title in ("base", *floors))])
        writer.writerows([k / RATE_HZ, *map("{:.6f}".format, row)] for k, row in enumerate(kept.T))
    return _case(file, words, missing, factors, zeta)


def _case(
    file: Path, words: str, missing: Sequence[Mapping[str, Any]], factors: Floats, zeta: float
) -> dict[str, Any]:
    truth = {"words": words, "missing": missing, "factors": factors.tolist(), "zeta": zeta}
    return {"building": file.name, **truth}


def _of_frame(
    kind: str, floors: Sequence[str], stories: Sequence[str], rng: np.random.Generator
) -> list[tuple[str, str, float]]:
    """What is hidden in a frame: effect, place and size; of a clean one masses that are off."""
    lost, place = float(rng.uniform(0.25, 0.5)), str(rng.choice(stories))
    if kind == "clean":
        spread = rng.uniform(0.0, 0.02)
        return [("added_mass", floor, spread * abs(rng.standard_normal())) for floor in floors]
    if kind == "mass":
        return [("added_mass", str(rng.choice(floors)), float(rng.uniform(0.1, 0.25)))]
    if kind == "walls":
        return [("wall_stiffness", place, -lost)]
    return [("cracked_columns", "all" if kind == "several" else place, -lost)]


def _hidden(
    stick: Stick,
    kind: str,
    floors: Sequence[str],
    stories: Sequence[str],
    base: Floats,
    rng: np.random.Generator,
) -> tuple[Stick, Callable[[Floats], Floats] | None, list[dict[str, Any]], str]:
    """A stick with what is hidden, what its channels do, the effects, and words."""
    count, level = len(floors), int(rng.integers(1, len(floors) + 1))
    floor, story, change = floors[level - 1], stories[level - 1], np.ones(len(floors))
    if kind == "clean":
        spread = rng.uniform(0.0, 0.02)
        change += spread * rng.standard_normal(count)
        return replace(stick, mass=stick.mass * change), None, [], f"masses to {spread:.2%}"
    if kind == "mass":
        size = float(rng.uniform(0.07, 0.2))
        change[level - 1] += size
        heavy = [effect("mass", floor, size=size)]
        return replace(stick, mass=stick.mass * change), None, heavy, ""
    if kind == "several":
        first, size = int(rng.integers(0, count - 1)), float(rng.uniform(0.1, 0.2))
        last = int(rng.integers(first + 2, count + 1))
        change[first:last] += size
        heavy = [effect("mass", *floors[first:last], size=size)]
        return replace(stick, mass=stick.mass * change), None, heavy, "one cause on several floors"
    if kind == "damper":
        size = float(rng.uniform(0.015, 0.04))
        damped = make.dashpot(level - 1, level, size)(stick)
        return damped, None, [effect("damper", story, size=size)], ""
    if kind == "brace":
        low = int(rng.integers(1, count - 1))
        spring = float(rng.uniform(0.1, 0.3)) * stick.stiffness[low + 1]
        braced = replace(stick, springs=((low, low + 2, spring),))
        return braced, None, [effect("brace", f"{floors[low - 1]}-{floors[low + 1]}")], ""
    if kind == "appendage":
        size, tuning = float(rng.uniform(0.05, 0.12)), rng.uniform(0.8, 2.5)
        hung = make.appendage(level, size, tuning, 0.02)(stick)
        return hung, None, [effect("appendage", floor, size=size)], ""
    if kind == "delay":
        size = STEP_S * round(float(rng.uniform(0.0025, 0.008)) / STEP_S)
        return stick, make.late(level, size), [effect("delay", floor, size=size)], ""
    if kind == "gain":
        size = float(rng.uniform(0.03, 0.08) * rng.choice([-1.0, 1.0]))
        return stick, make.gain(level, size), [effect("gain", floor, size=size)], ""
    if kind == "reversed":
        return stick, make.gain(level, -2.0), [effect("reversed", floor)], ""
    if kind == "exchanged":
        low = max(level - 1, 1)
        order = np.arange(count + 1)
        order[[low, low + 1]] = low + 1, low
        return stick, lambda a: a[order], [effect("exchanged", *floors[low - 1 : low + 1])], ""
    if kind == "pair":
        both: list[dict[str, Any]] = []
        channels = None
        for part in rng.choice([["mass", "delay"], ["mass", "damper"], ["brace", "gain"]]):
            stick, more, parts, _ = _hidden(stick, str(part), floors, stories, base, rng)
            channels, both = more or channels, both + parts
        return stick, channels, both, ""
    if kind == _OUTSIDE and rng.uniform() < 0.5:
        tie = (0, count, 0.1 * float(stick.stiffness[-1]))
        return replace(stick, springs=(tie,)), None, [], "a tie from the roof to the ground"
    drift = np.diff(_displacements(stick, 3.0 * base), axis=0, prepend=0.0)[level - 1]
    peak = float(np.abs(drift).max())
    if kind == _OUTSIDE:
        gap = 0.4 * float(np.abs(_displacements(stick, 3.0 * base)[level - 1]).max())
        struck = replace(stick, pounding=(level, gap, 0.3 * float(stick.stiffness[level - 1])))
        return struck, None, [], "pounding"
    # Yields at a share of the peak of the elastic drift, sharply or smoothly.
    ductility, alpha = float(rng.uniform(1.5, 4.0)), float(rng.choice([0.05, 0.1, 0.2]))
    law = make.hysteretic if rng.uniform() < 0.5 else make.bilinear
    yielding = law(level - 1, peak / ductility, alpha)(stick)
    words = f"{law.__name__}, {alpha} beyond 1/{ductility:.1f} of the elastic peak"
    return yielding, None, [effect("nonlinear", story)], words


def _displacements(stick: Stick, base: Floats) -> Floats:
    """(f, n) of the floors against the base, above .2 Hz."""
    relative = np.fft.rfft(stick.respond(base) - base, axis=1)
    turning = 2.0 * np.pi * np.fft.rfftfreq(len(base), STEP_S)
    relative[:, turning < 2.0 * np.pi * 0.2] = 0.0
    return np.fft.irfft(relative / -(np.maximum(turning, 1.0) ** 2), len(base), axis=1)


def answer(case: Mapping[str, Any], name: str, kind: str, folder: Path) -> dict[str, Any]:
    """What `diagnose` says of a case, or `repair` where several causes are hidden."""
    file, started = folder / case["building"], time.process_time()
    study, measured = folder / "studies" / Path(file).stem, folder / f"{name}.csv"
    if kind == "pair":
        report: Any = femupdate.repair(study, measured, building=file)
        found, base = report.repair.last, report.repair.before
        named = [added.finding for added in report.repair.rounds]
        verdict = "partly" if named else found.verdict
    else:
        report = femupdate.diagnose(study, measured, building=file)
        found, base = report.diagnosis, report.diagnosis.base
        verdict = found.verdict
        named = [] if verdict in ("none", "unknown") else list(found.pair or found.findings[:1])
    points = report.problem.effective
    effects = [
        {
            "kind": "nonlinear"
            if finding.placed.effect.name == "amplitude_softening"
            else KINDS.get(finding.placed.effect.name, finding.placed.effect.name),
            "places": places_of(finding.placed.effect.name, finding.placed.place, file),
            "size": finding.told[0],
            "size_sd": finding.told[1],
            "removes": (base.chi2 - finding.fitted.chi2) / max(base.chi2 - points, 1.0),
        }
        for finding in named
    ]
    return {
        "verdict": verdict,
        "effects": effects,
        "alike": list(found.twins),
        "strength": float(np.sqrt(max(base.chi2 - points, 0.0))),
        "sentence": found.sentence,
        "seconds": time.process_time() - started,
    }


def judged(case: Mapping[str, Any], kind: str) -> dict[str, Any]:
    """What is right in an answer: names, false ones, sizes."""
    if "failed" in case:
        return {"right": False, "false": 0, "names": 0, "sizes": []}
    hidden = {_name(one): one for one in case["missing"]}
    told = {_name(one): one for one in case["effects"]}
    sure = case["verdict"] not in ("ambiguous", "indistinguishable", "unknown", "none")
    false = told.keys() - hidden.keys() if sure else set()
    if case["verdict"] == _NONLINEAR:
        false = set() if kind in (_NONLINEAR, _OUTSIDE) else false
    right = told.keys() == hidden.keys() and (sure or not told)
    if kind == _OUTSIDE:
        right = not false
    if kind in ("clean", _NONLINEAR):
        right = case["verdict"] == ("none" if kind == "clean" else _NONLINEAR)
    sizes = [
        abs(told[key]["size"] - hidden[key]["size"]) <= 2.0 * told[key]["size_sd"]
        for key in told.keys() & hidden.keys()
        if sure and hidden[key]["size"] is not None
    ]
    return {"right": right, "false": len(false), "names": len(told) if sure else 0, "sizes": sizes}


def _name(one: Mapping[str, Any]) -> tuple[str, tuple[str, ...]]:
    return one["kind"], tuple(sorted(one["places"]))


def figures(told: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Counts over all cases, by name: each is (number, of how many)."""
    kinds = {name: name.partition("-")[0] for name in told}
    marks = {name: judged(case, kinds[name]) for name, case in told.items()}

    def share(names: Sequence[str]) -> tuple[int, int]:
        return sum(bool(marks[name]["right"]) for name in names), len(names)

    def of(*wanted: str) -> list[str]:
        return [name for name in told if kinds[name] in wanted]

    others = ("clean", _NONLINEAR, _OUTSIDE, *_SEVERAL, *_MEASURED)
    single = [name for name in told if kinds[name] not in others]
    strong = [name for name in single if told[name].get("strength", 0.0) >= 6.0]
    sizes = [size for mark in marks.values() for size in mark["sizes"]]
    seconds = sorted(case["seconds"] for case in told.values() if "seconds" in case)
    return {
        "false names": (sum(mark["false"] > 0 for mark in marks.values()), len(marks)),
        "clean": share(of("clean")),
        "single": share(single),
        "single, D >= 6": share(strong),
        "pairs and several": share(of(*_SEVERAL)),
        "nonlinear": share(of(_NONLINEAR)),
        "outside": share(of(_OUTSIDE)),
        **{kind: share(of(kind)) for kind in _MEASURED},
        "sizes within 2 sd": (sum(sizes), len(sizes)),
        "crashes": (sum("failed" in case for case in told.values()), len(told)),
        "median CPU s": float(np.median(seconds)) if seconds else None,
    }


def main(folder: Path, pattern: str = "*", seed: str = "0") -> None:
    """Answer all cases of the pattern that are not answered yet, and write the results."""
    write_buildings(folder)
    for name, kind, building, number in cases():
        kept = folder / f"{name}.json"
        if kept.exists() or not fnmatch(name, pattern):
            continue
        try:
            case = make_case(name, kind, building, number, folder, int(seed))
            case |= answer(case, name, kind, folder)
        except Exception:  # a crash is a result
            case = {"missing": [], "effects": [], "failed": traceback.format_exc()}
        kept.write_text(json.dumps(case, indent=1) + "\n")
        mark = judged(case, kind)
        print(name, case.get("verdict", "FAILED"), mark, case.get("words"), flush=True)
    told = {
        name: json.loads((folder / f"{name}.json").read_text())
        for name, *_ in cases()
        if (folder / f"{name}.json").exists()
    }
    totals = figures(told)
    text = "\n".join(f"{key}: {value}" for key, value in totals.items())
    print(text)
    Job(folder, int(seed)).write("fresh_effects", {"figures": totals, "cases": told}, text)


if __name__ == "__main__":
    if sys.argv[1:] in ([], ["--help"]):
        print(__doc__)
    else:
        main(Path(sys.argv[1]), *sys.argv[2:])
