"""Counts of how much there is to keep: `python tests/house.py` prints them beside their limits.

`--lower` writes today's count into house.toml wherever it is below its limit. Nothing writes a
higher one but a person, with the reason in the commit.
"""

import ast
import re
import sys
import tomllib
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIMITS = ROOT / "tests" / "house.toml"
FUNCTION = (ast.FunctionDef, ast.AsyncFunctionDef)
IMPORT = (ast.Import, ast.ImportFrom)


def module_name(path):
    """The name by which a file of the library, or of the command, is imported."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = ("femupdate", *parts) if parts[0] == "cli" else parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_names(text):
    """Module and name of every `from ... import ...` of the library anywhere in a file."""
    for module, names in re.findall(r"^ *from (\S+) import (\([^)]*\)|.*)$", text, re.M):
        if module.startswith("."):
            module = f"femupdate.cli{module}".rstrip(".")
        if module.startswith("femupdate"):
            for name in re.sub(r"#.*", "", names).strip("()").split(","):
                if name.strip():
                    yield module, name.split()[0]


def code_lines(text, tree):
    """Lines that are neither blank, comment, docstring nor import."""
    lines = text.splitlines()
    out = {n for n, line in enumerate(lines, 1) if not line.strip() or line.strip()[0] == "#"}
    for node in ast.walk(tree):
        if isinstance(node, IMPORT):
            out.update(range(node.lineno, node.end_lineno + 1))
        documented = isinstance(node, (ast.Module, ast.ClassDef, *FUNCTION))
        if documented and ast.get_docstring(node, clean=False) is not None:
            out.update(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    return len(lines) - len(out)


def pieces(tree):
    """Parts of a file that may call a helper: functions, methods, what else a class holds, rest."""
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            yield from (item for item in node.body if isinstance(item, FUNCTION))
            yield [item for item in node.body if not isinstance(item, FUNCTION)]
        elif not isinstance(node, IMPORT):
            yield node


def names_in(piece):
    """Names that a piece of a file reads."""
    nodes = piece if isinstance(piece, list) else [piece]
    return {item.id for node in nodes for item in ast.walk(node) if isinstance(item, ast.Name)}


def helpers_with_one_caller(tree):
    """How many private functions of a file are named in only one other place of it."""
    helpers = [n for n in tree.body if isinstance(n, FUNCTION) and re.match("_[a-z]", n.name)]
    read = [(getattr(piece, "name", None), names_in(piece)) for piece in pieces(tree)]
    callers = Counter(name for own, names in read for name in names if name != own)
    return sum(callers[helper.name] == 1 for helper in helpers)


def number_constants(tree):
    """How many constants of a file hold a number: NAME = ... at its top, or in a class NAME."""
    groups = [n for n in tree.body if isinstance(n, ast.ClassDef) and n.name.isupper()]
    for node in (*tree.body, *(inner for group in groups for inner in group.body)):
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value is not None:
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            values = (n.value for n in ast.walk(node.value) if isinstance(n, ast.Constant))
            if isinstance(target, ast.Name) and (target.id.isupper() or node not in tree.body):
                yield any(type(value) in (int, float) for value in values)


def is_dataclass(node):
    return any("dataclass" in ast.unparse(decorator) for decorator in node.decorator_list)


def read(*folders, suffix=".py"):
    """Text of every file under the folders, or of a single file, by its path."""
    paths = [
        path
        for folder in folders
        for path in ([ROOT / folder] if folder.endswith(suffix) else (ROOT / folder).rglob("*"))
        if path.suffix == suffix
    ]
    return {path: path.read_text(encoding="utf-8") for path in sorted(paths)}


def house_counts():
    """Every count by its name."""
    texts = read("femupdate", "cli")
    trees = {path: ast.parse(text) for path, text in texts.items()}
    modules = {module_name(path) for path in texts}
    arrows = {
        (path, target)
        for path, text in texts.items()
        for module, name in imported_names(text)
        for target in (module, f"{module}.{name}")
        if target in modules and target != module_name(path)
    }
    classes = [n for tree in trees.values() for n in tree.body if isinstance(n, ast.ClassDef)]
    fields = (n for node in classes if is_dataclass(node) for n in node.body)
    functions = [n for tree in trees.values() for n in ast.walk(tree) if isinstance(n, FUNCTION)]
    tests = read("tests")
    tested = [text for path, text in tests.items() if "benchmarks" not in path.parts]
    docs = read("docs", "README.md", "CONTRIBUTING.md", "CHANGELOG.md", suffix=".md")
    whole = "".join(texts.values())
    variables = r"\b{0}\b ?(?:=|,|in |:)|for {0} in"
    return {
        "installed lines": whole.count("\n"),
        "code lines": sum(code_lines(text, trees[path]) for path, text in texts.items()),
        "files": len(texts),
        "classes": len(classes),
        "fields of dataclasses": sum(isinstance(n, ast.AnnAssign) for n in fields),
        "imports from file to file": len(arrows),
        "class names that stand for two things": sum(
            count > 1 for count in Counter(node.name for node in classes).values()
        ),
        "private helpers with one caller": sum(map(helpers_with_one_caller, trees.values())),
        "functions above eighty lines": sum(n.end_lineno - n.lineno >= 80 for n in functions),
        "chosen numbers": sum(sum(number_constants(tree)) for tree in trees.values()),
        "internal names imported by tests": len(
            {(m, n) for text in tested for m, n in imported_names(text) if m.count(".") > 1}
        ),
        "variables named one or own": sum(
            len(re.findall(variables.format(word), whole)) for word in ("one", "own")
        ),
        "lines of tests": sum(text.count("\n") for text in tests.values()),
        "words of docs": sum(len(text.split()) for text in docs.values()),
    }


def limits():
    """The highest allowed counts, by name."""
    return tomllib.loads(LIMITS.read_text(encoding="utf-8"))


def lower():
    """Writes today's counts into the table wherever they are below it."""
    now, before = house_counts(), limits()
    head = [line for line in LIMITS.read_text(encoding="utf-8").splitlines() if line[:1] == "#"]
    rows = [f'"{name}" = {min(count, before.get(name, count))}' for name, count in now.items()]
    LIMITS.write_text("\n".join(head + rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if "--lower" in sys.argv[1:]:
        lower()
    for name, count in house_counts().items():
        print(f"{name:38} {count:6}  at most {limits()[name]}")
