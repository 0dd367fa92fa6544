"""What is installed: all of it, nothing else, and nothing heavy on import."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = {"femupdate": "femupdate", "cli": "femupdate.cli", "models": "femupdate.models"}
if (ROOT / "examples").exists():
    FOLDERS["examples"] = "femupdate.examples"
BENCHMARKS = "tests/benchmarks"
HEAVY = ("torch", "pyvista", "vtk", "matplotlib", "xarray", "pandas", "scipy", "numpy", "arviz")


def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def python_files():
    """Installed name of every Python file, femupdate/fe/beam.py for instance."""
    found = set()
    for folder, package in FOLDERS.items():
        for path in (ROOT / folder).rglob("*.py"):
            inside = path.relative_to(ROOT / folder)
            found.add("/".join([*package.split("."), *inside.parts]))
    return found


def loaded_after(statement):
    script = f"import sys\n{statement}\nprint(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT, check=True
    )
    return set(done.stdout.split())


def test_importing_femupdate_is_light():
    assert loaded_after("import femupdate").isdisjoint(HEAVY)


def test_rooms_are_light_until_something_in_them_is_used():
    rooms = sorted(name for name in project()["tool"]["setuptools"]["packages"])
    assert loaded_after("\n".join(f"import {name}" for name in rooms)).isdisjoint(HEAVY)


def test_the_record_of_a_study_needs_nothing_heavy():
    light = "import femupdate.study, femupdate.units, femupdate.errors, femupdate.storage"
    assert loaded_after(light).isdisjoint(HEAVY)


def test_the_steps_of_the_work_draw_nothing():
    steps = ("build", "calibrate", "predict", "diagnose", "repair", "train")
    steps = (*(f"workflow.{name}" for name in steps), "simulation.simulate")
    loaded = loaded_after("\n".join(f"import femupdate.{name}" for name in steps))
    assert "torch" in loaded
    assert loaded.isdisjoint({"pyvista", "vtk", "vtkmodules", "matplotlib"})


def test_the_packages_listed_are_the_folders_that_hold_python_files():
    """One that is left out is silently missing from what is installed."""
    settings = project()["tool"]["setuptools"]
    there = {"/".join(name.split("/")[:-1]).replace("/", ".") for name in python_files()}
    assert set(settings["packages"]) == there
    assert len(settings["packages"]) == len(set(settings["packages"]))
    mapped = settings["package-dir"]
    assert {folder: name for name, folder in mapped.items()} == FOLDERS


def test_everything_imported_is_declared():
    declared = {re.split(r"[<>=\[;]", one)[0] for one in project()["project"]["dependencies"]}
    optional = project()["project"]["optional-dependencies"]
    used = ("ambient", "arviz", "benchmark", "formats", "opensees")
    extras = [one for name in used for one in optional[name]]
    # VTK is PyVista's, pydantic_core pydantic's; the others go by other names.
    brought = {"femupdate", "vtkmodules", "pydantic_core", "sklearn", "pyoma2", "nptdms"}
    brought |= {"PIL"}
    allowed = declared | brought | {re.split(r"[<>=]", one)[0] for one in extras}
    wrong = set()
    paths = [path for folder in (*FOLDERS, BENCHMARKS) for path in (ROOT / folder).rglob("*.py")]
    for path in [path for path in paths if not path.name.startswith("test_")]:
        # A script may import a module beside it.
        beside = {other.stem for other in path.parent.glob("*.py")}
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module or ""]
            tops = {name.split(".")[0] for name in names}
            wrong |= {(path.name, top) for top in tops - allowed - beside - sys.stdlib_module_names}
    assert not wrong


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """A wheel built from a copy of what is in the repository, without the network."""
    setuptools = pytest.importorskip("setuptools")
    if int(setuptools.__version__.split(".")[0]) < 77:
        pytest.skip("building a wheel needs setuptools 77 or newer in the environment")
    copy = tmp_path_factory.mktemp("wheel") / "project"
    skipped = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for folder in (*FOLDERS, "tests"):
        shutil.copytree(ROOT / folder, copy / folder, ignore=skipped)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy / name)
    script = "from setuptools.build_meta import build_wheel; build_wheel('dist')"
    subprocess.run(
        [sys.executable, "-c", script], cwd=copy, check=True, capture_output=True, timeout=120
    )
    (path,) = (copy / "dist").glob("*.whl")
    with zipfile.ZipFile(path) as archive:
        yield archive


def data_files():
    """Installed name of every file beside the Python files."""
    found = set()
    for folder, package in FOLDERS.items():
        for path in (ROOT / folder).rglob("*"):
            if path.is_file() and path.suffix not in {".py", ".pyc"}:
                inside = path.relative_to(ROOT / folder)
                found.add("/".join([*package.split("."), *inside.parts]))
    return found


def test_the_wheel_holds_every_file_and_nothing_else(wheel):
    names = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert "femupdate/models/shear_4dof.toml" in names
    assert names == python_files() | data_files()


def test_benchmarks_are_in_a_checkout_alone(wheel, tmp_path):
    """The installed command says how to get them."""
    assert (ROOT / BENCHMARKS / "__main__.py").exists()
    names = [name for name in wheel.namelist() if "benchmark" in name]
    assert names == ["femupdate/cli/benchmark.py"]
    wheel.extractall(tmp_path)
    script = "from femupdate.cli.main import main; main(['benchmark', 'solver', '--sizes', ''])"
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
    )
    assert done.returncode == 1
    (sentence,) = done.stderr.splitlines()
    assert sentence.startswith("Error: the benchmarks are not part of the installed package")
    assert "clone the repository" in sentence


def test_python_m_runs_the_benchmarks_of_a_checkout():
    done = subprocess.run(
        [sys.executable, "-m", "femupdate.benchmarks", "solver", "--help"],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=True,
    )
    assert "femupdate benchmark solver" in done.stdout
