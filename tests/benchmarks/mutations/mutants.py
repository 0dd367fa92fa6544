"""Small changes of a source file: one operator, comparison, sign or number at a time."""

import ast
import copy
import gc
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, FunctionType

_OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult,
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip
# Texts, types and messages: what changes in them is no change of the calculation.
_UNTOUCHED = (ast.JoinedStr, ast.Raise, ast.arguments)


@dataclass(frozen=True)
class Mutant:
    """A change of one function.

    Attributes:
        function: its qualified name.
        line: of the change.
        before, after: the expression.
        code: of the changed function.
    """

    function: str
    line: int
    before: str
    after: str
    code: CodeType

    def install(self) -> None:
        """Give all functions of this place the changed code, for the rest of the process."""
        for one in gc.get_objects():
            # What stands in for another object may warn, or fail, when asked for its class.
            if type(one) is FunctionType and _same_place(one.__code__, self.code):
                one.__code__ = self.code


def mutants_of(path: Path) -> Iterator[Mutant]:
    """All changes of the functions of a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    originals = {code.co_qualname: code for code in _codes(compile(tree, str(path), "exec"))}
    for number in range(len(list(_sites(tree)))):
        changed = copy.deepcopy(tree)
        site = list(_sites(changed))[number]
        before = ast.unparse(site)
        _change(site)
        for code in _codes(compile(changed, str(path), "exec")):
            if code != originals[code.co_qualname]:
                yield Mutant(code.co_qualname, site.lineno, before, ast.unparse(site), code)
                break


def _sites(node: ast.AST, inside: bool = False) -> Iterator[ast.expr | ast.stmt]:
    """Expressions of functions that can be changed, in the order of the file."""
    if isinstance(node, _UNTOUCHED):
        return
    inside = inside or isinstance(node, ast.FunctionDef)
    if inside and isinstance(node, ast.expr | ast.stmt) and _can_change(node):
        yield node
    for name, _ in ast.iter_fields(node):
        if name not in ("annotation", "returns", "decorator_list"):
            value = getattr(node, name)
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from _sites(child, inside)


def _can_change(node: ast.expr | ast.stmt) -> bool:
    match node:
        case ast.BinOp(op=op) | ast.AugAssign(op=op) | ast.BoolOp(op=op):
            return type(op) in _OPERATORS
        case ast.Compare(ops=[op]):
            return type(op) in _OPERATORS
        case ast.UnaryOp(op=ast.USub()):
            return not isinstance(node.operand, ast.Constant)
        case ast.Constant(value=bool()):
            return False
        case ast.Constant(value=int() | float()):
            return True
    return False


def _change(node: ast.expr | ast.stmt) -> None:
    """In place: the node's other operator, the other sign, or the next number."""
    match node:
        case ast.BinOp() | ast.AugAssign() | ast.BoolOp():
            node.op = _OPERATORS[type(node.op)]()  # type: ignore[assignment]
        case ast.Compare(ops=[op]):
            node.ops = [_OPERATORS[type(op)]()]  # type: ignore[list-item]
        case ast.UnaryOp():
            node.op = ast.UAdd()
        case ast.Constant(value=int() as number):
            node.value = number + 1
        case ast.Constant(value=float() as number):
            node.value = 1.1 * number if number else 1.0


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Of the functions and methods of a module, without those inside of functions."""
    for one in code.co_consts:
        if isinstance(one, CodeType) and "<locals>" not in one.co_qualname:
            is_class = not one.co_flags & 0x2  # CO_NEWLOCALS: functions alone have it
            yield from _codes(one) if is_class else (one,)


def _same_place(one: CodeType, other: CodeType) -> bool:
    names = "co_filename", "co_qualname", "co_firstlineno"
    return all(getattr(one, name) == getattr(other, name) for name in names)
