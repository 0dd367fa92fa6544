"""No file that is read can run a program: pickles, evaluation and YAML tags are not used."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCES = [path for room in ("femupdate", "cli") for path in (ROOT / room).rglob("*.py")]
MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "shelve", "marshal", "yaml"}
HARMFUL = {("allow_pickle", True), ("allow_pickle", None), ("shell", True)}
CALLS = {"eval", "exec", "compile", "__import__"}


def names_of(call):
    """Name of a called function, and with what stands before it."""
    if isinstance(call.func, ast.Name):
        return {call.func.id}
    if isinstance(call.func, ast.Attribute):
        return {ast.unparse(call.func)}
    return set()


def offences(source):
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found += [one.name for one in node.names if one.name.split(".")[0] in MODULES]
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in MODULES:
            # A view of bytes, which reads nothing.
            if [one.name for one in node.names] != ["PickleBuffer"]:
                found.append(node.module)
        elif isinstance(node, ast.Call):
            found += names_of(node) & (CALLS | {"torch.load", "torch.save"})
            found += [
                word.arg
                for word in node.keywords
                if (word.arg, getattr(word.value, "value", None)) in HARMFUL
            ]
    return found


def test_the_test_itself():
    assert offences("import pickle") == ["pickle"]
    assert offences("from yaml import load") == ["yaml"]
    assert offences("from pickle import PickleBuffer") == []
    assert offences("from pickle import PickleBuffer, loads") == ["pickle"]
    assert offences("eval('1')") == ["eval"]
    assert offences("np.load(f, allow_pickle=True)") == ["allow_pickle"]
    assert offences("np.load(f, allow_pickle=False); re.compile('a'); subprocess.run(a)") == []
    assert offences("torch.load(f)") == ["torch.load"]


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_source_runs_what_a_file_says(path):
    assert offences(path.read_text(encoding="utf-8")) == []


def test_numpy_archives_are_read_in_one_place():
    """With their headers checked first; np.load elsewhere would not."""
    users = [path.name for path in SOURCES if "np.load(" in path.read_text(encoding="utf-8")]
    assert users == ["storage.py"]
