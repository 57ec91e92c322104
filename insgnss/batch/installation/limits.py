"""The numeric constants of the package with their reasons, read from its sources.

A reason is the comment behind a constant or above it, or the docstring below it. Nothing is
imported, so that the list is there whatever an installation lacks.
"""

import ast
import io
import tokenize
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

PACKAGE_DIRECTORY = Path(__file__).parents[2]  # this file stands two folders deep


@dataclass(frozen=True)
class Limit:
    """A constant of a module, or several that one line defines.

    Parameters
    ----------
    name : str
        As the module has it.
    value : str
        The expression that gives it.
    reason : str
        What it limits, its unit and why it has this value; empty where the source does not say.
    module : str
        Its file in the package.
    """

    name: str
    value: str
    reason: str
    module: str = ""


@dataclass(frozen=True)
class Limits:
    """All numeric constants of the package, in the order of its modules."""

    limits: tuple[Limit, ...]

    def summary(self) -> str:
        """Return the text for the terminal: a heading a wing, then a line a constant."""
        lines, wing = [], ""
        for limit in self.limits:
            if (begins := limit.module.partition("/")[0]) != wing:
                lines.append(wing := begins)
            lines.append(f"  {limit.module}  {limit.name} = {limit.value}  {limit.reason}".rstrip())
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        return {"limits": [asdict(limit) for limit in self.limits]}


def read_limits(package: Path = PACKAGE_DIRECTORY) -> Limits:
    """Read the constants of all modules of a package."""
    modules = [(path, path.relative_to(package).as_posix()) for path in package.rglob("*.py")]
    return Limits(
        tuple(
            limit
            for path, module in sorted(modules, key=lambda entry: entry[1])
            for limit in limits_of(path.read_text(encoding="utf-8"), module)
        )
    )


def limits_of(text: str, module: str = "") -> Iterator[Limit]:
    """Read the constants of a module's text that are numbers."""
    tokens = list(tokenize.generate_tokens(io.StringIO(text).readline))
    comments = {t.start[0]: t for t in tokens if t.type == tokenize.COMMENT}
    body = ast.parse(text).body
    for node, following in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign) or not _is_number(node.value):
            continue
        name = ast.unparse(node.targets[0]).strip("()")
        if name.isupper():
            first = node.lineno
            while first - 1 in comments and comments[first - 1].start[1] == 0:
                first -= 1
            lines = range(first, (node.end_lineno or node.lineno) + 1)
            notes = [comments[line].string.lstrip("# ") for line in lines if line in comments]
            if isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant):
                notes.append(str(following.value.value))
            reason = " ".join(" ".join(notes).split())
            yield Limit(name, ast.unparse(node.value), reason, module)


def _is_number(node: ast.expr) -> bool:
    """Whether an expression is made of numbers alone, in tuples, sums and conversions of units."""
    match node:
        case ast.Constant(value=value):
            return isinstance(value, int | float) and not isinstance(value, bool)
        case ast.UnaryOp(operand=inner):
            return _is_number(inner)
        case ast.BinOp(left=left, right=right):
            return _is_number(left) or _is_number(right)
        case ast.Tuple(elts=[_, *_] as parts):
            return all(map(_is_number, parts))
        case ast.Call(args=[inner, *_]):
            return _is_number(ast.Tuple(inner.elts) if isinstance(inner, ast.List) else inner)
    return False
