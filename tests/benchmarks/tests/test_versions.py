"""The benchmark `versions`: the lower bounds that it installs."""

import tomllib

from femupdate.benchmarks.versions.run import ROOT, crash, lowest


def test_lower_bounds_become_versions():
    assert lowest(["numpy>=1.26", "torch>=2.6,<2.14", "pyOMA_2>=1.4"]) == [
        "numpy==1.26",
        "torch==2.6",
        "pyOMA_2==1.4",
    ]


def test_a_crash_is_told_by_its_innermost_calls():
    calls = [f'  File "{name}.py", line {n} in {name}\n' for n, name in enumerate("abcdefghij")]
    dump = (
        "Fatal Python error: Segmentation fault\n\nCurrent thread 0x7f (most recent call first):\n"
    )
    told = crash(f"..... [ 46%]\n{dump}{''.join(calls)}\nExtension modules: x (total: 1)\n")
    assert told.startswith("Fatal Python error: Segmentation fault Current thread 0x7f")
    assert 'File "a.py", line 0 in a' in told
    assert "i.py" not in told
    assert crash("a" * 400) == "a" * 300


def test_every_dependency_has_a_lower_bound():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert len(lowest(project["dependencies"])) == len(project["dependencies"])
    extras = project["optional-dependencies"]
    assert all(len(lowest(own)) == len(own) for own in extras.values())
