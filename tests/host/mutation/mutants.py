"""All mutants of a Python file: one operator, constant, condition or refusal changed at a time."""

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Add,
    ast.Div: ast.Mult,
}
CHANGED = ast.If | ast.IfExp | ast.Compare | ast.BoolOp | ast.BinOp | ast.Constant | ast.UnaryOp


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutant:
    """One change of one file."""

    path: Path
    line: int
    what: str
    node: int  # which one, in the order of `_nodes`
    variant: int

    def __str__(self) -> str:
        return f"{self.path.name}:{self.line}: {self.what}"

    def tree(self) -> ast.Module:
        """Return the changed code."""
        tree = ast.parse(self.path.read_text(encoding="utf-8"))
        _change(list(_nodes(tree))[self.node], self.variant)
        return ast.fix_missing_locations(tree)


def mutants(path: Path) -> Iterator[Mutant]:
    """Yield every mutant of a file, in the order of its nodes."""
    for index, node in enumerate(_nodes(ast.parse(path.read_text(encoding="utf-8")))):
        for variant in range(2 if isinstance(node, CHANGED) else 0):
            if what := _change(copy.deepcopy(node), variant):
                line = getattr(node, "lineno", 0)
                yield Mutant(path=path, line=line, what=what, node=index, variant=variant)


def _nodes(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield the nodes whose change matters: not annotations, docstrings and texts."""
    pending: list[ast.AST] = [tree]
    while pending:
        node = pending.pop(0)
        yield node
        for name, field in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list", "bases") and not isinstance(
                node, ast.AnnAssign
            ):
                continue
            children = field if isinstance(field, list) else [field]
            pending += [child for child in children if isinstance(child, ast.AST)]


def _change(node: ast.AST, variant: int) -> str:
    """Change the node; return what was changed, empty if there is no such variant."""
    if isinstance(node, ast.If | ast.IfExp):
        node.test = ast.Constant(value=bool(variant))
        return f"if {bool(variant)}"
    what = ""
    match node:
        case _ if variant:
            pass
        case ast.Compare(ops=[operator, *_]) if type(operator) in COMPARISONS:
            new = COMPARISONS[type(operator)]
            node.ops[0] = new()
            what = f"{type(operator).__name__} -> {new.__name__}"
        case ast.BoolOp():
            node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
            what = f"now {type(node.op).__name__}"
        case ast.BinOp() if type(node.op) in ARITHMETIC:
            old, node.op = type(node.op), ARITHMETIC[type(node.op)]()
            what = f"{old.__name__} -> {type(node.op).__name__}"
        case ast.Constant(value=bool(value)):
            node.value = not value
            what = f"{value} -> {not value}"
        case ast.Constant(value=int(value) | float(value)):
            node.value = value + 1
            what = f"{value} -> {value + 1}"
        case ast.UnaryOp(op=ast.Not()):
            node.operand = ast.UnaryOp(op=ast.Not(), operand=node.operand)
            what = "without not"
    return what
