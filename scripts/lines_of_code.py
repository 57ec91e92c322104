"""Count the package's lines of code by wing: without docstrings, comments and blank lines.

    python scripts/lines_of_code.py             of insgnss/, total last
    python scripts/lines_of_code.py tests       of another folder

A wing is a folder at the top of the one that is counted; files beside the folders are counted under
its own name.
"""

import ast
import io
import sys
import tokenize
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LAYOUT = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}
LAYOUT |= {tokenize.ENDMARKER}


def lines_of_code(text: str) -> int:
    """Return the number of lines on which code stands; a string in code counts with all of its."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in LAYOUT:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        text_alone = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if text_alone and isinstance(node.value.value, str):
            lines.difference_update(range(node.lineno, (node.end_lineno or 0) + 1))
    return len(lines)


def by_wing(folder: Path) -> Counter[str]:
    """Return the lines of code of each wing of a folder."""
    count: Counter[str] = Counter()
    for path in sorted(folder.rglob("*.py")):
        parts = path.relative_to(folder).parts
        wing = parts[0] if len(parts) > 1 else folder.name
        count[wing] += lines_of_code(path.read_text(encoding="utf-8"))
    return count


if __name__ == "__main__":
    count = by_wing(ROOT / (sys.argv[1] if len(sys.argv) > 1 else "insgnss"))
    for wing, lines in sorted(count.items()):
        print(f"{lines:7d}  {wing}")
    print(f"{count.total():7d}  total")
