"""The benchmark `versions`: the lower bounds that it installs."""

import tomllib

from femupdate.benchmarks.versions.run import ROOT, lowest


def test_lower_bounds_become_versions():
    assert lowest(["numpy>=1.26", "torch>=2.6,<2.14", "pyOMA_2>=1.4"]) == [
        "numpy==1.26",
        "torch==2.6",
        "pyOMA_2==1.4",
    ]


def test_every_dependency_has_a_lower_bound():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert len(lowest(project["dependencies"])) == len(project["dependencies"])
    extras = project["optional-dependencies"]
    assert all(len(lowest(own)) == len(own) for own in extras.values())
