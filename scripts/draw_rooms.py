"""Draw docs/rooms.svg: the wings of the package and what each imports, read from the sources.

    python scripts/draw_rooms.py [--out docs/rooms.svg]

A wing is a folder of insgnss/; an arrow says that a wing imports another. Arrows that follow from
others are left out, and so are those to `base`, `geodesy` and `records`, which all wings import.
"""

import argparse
import ast
from graphlib import TopologicalSorter
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "insgnss"
GROUND = ("base", "geodesy", "records")
WIDTH, HEIGHT, GAP_X, GAP_Y = 1.72, 0.46, 0.22, 0.62


def imported_wings(path: Path) -> set[str]:
    """Return the wings that a file imports, at its top or inside functions."""
    package = path.relative_to(PACKAGE.parent).with_suffix("").parts[:-1]
    wings = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.ImportFrom):
            continue
        base = list(package[: len(package) - node.level + 1]) if node.level else []
        full = [*base, *(node.module.split(".") if node.module else [])]
        names = [full] if len(full) > 1 else [[*full, alias.name] for alias in node.names]
        wings |= {name[1] for name in names if name[0] == "insgnss" and len(name) > 1}
    return wings


def stands_on() -> dict[str, set[str]]:
    """Return what each wing imports directly, less what follows from others."""
    wings = {p.name for p in PACKAGE.iterdir() if p.is_dir() and (p / "__init__.py").exists()}
    graph = {
        wing: set().union(*(imported_wings(p) for p in (PACKAGE / wing).rglob("*.py"))) & wings
        for wing in wings
    }
    graph = {wing: below - {wing} - set(GROUND) for wing, below in graph.items()}
    reach: dict[str, set[str]] = {}
    for wing in TopologicalSorter(graph).static_order():
        reach[wing] = graph[wing].union(*(reach[below] for below in graph[wing]))
    return {
        wing: {b for b in below if not any(b in reach[other] for other in below - {b})}
        for wing, below in graph.items()
        if wing not in GROUND
    }


def main() -> None:
    """Write the drawing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=PACKAGE.parent / "docs" / "rooms.svg")
    out = parser.parse_args().out
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "insgnss"
    import matplotlib.pyplot as plt

    graph = stands_on()
    level: dict[str, int] = {}
    for wing in TopologicalSorter(graph).static_order():
        level[wing] = 1 + max((level[below] for below in graph[wing]), default=0)
    rows = [sorted(r for r in level if level[r] == k) for k in range(1, max(level.values()) + 1)]
    place: dict[str, tuple[float, float]] = {}
    for k, row in enumerate(rows, start=1):
        wish = {
            r: sum(place[b][0] for b in graph[r]) / len(graph[r]) if graph[r] else 0 for r in row
        }
        row = sorted(row, key=lambda r: (wish[r], r))
        for i, wing in enumerate(row):
            place[wing] = ((i - (len(row) - 1) / 2) * (WIDTH + GAP_X), k * (HEIGHT + GAP_Y))
    span = max(len(row) for row in rows) * (WIDTH + GAP_X)
    figure, axes = plt.subplots(figsize=(span + 0.3, (len(rows) + 1) * (HEIGHT + GAP_Y)))
    style = {"boxstyle": "round,pad=0.02,rounding_size=0.08", "linewidth": 1.0}
    from matplotlib.patches import FancyBboxPatch

    def box(x: float, y: float, width: float, text: str, face: str) -> None:
        axes.add_patch(
            FancyBboxPatch((x - width / 2, y), width, HEIGHT, fc=face, ec="#33475b", **style)
        )
        axes.text(x, y + HEIGHT / 2, text, ha="center", va="center", fontsize=11, color="#1b2733")

    for wing, below in graph.items():
        for other in below:
            (x0, y0), (x1, y1) = place[wing], place[other]
            arrow = {
                "arrowstyle": "-|>",
                "color": "#8aa0b5",
                "linewidth": 0.9,
                "shrinkA": 0,
                "shrinkB": 0,
            }
            axes.annotate("", (x1, y1 + HEIGHT + 0.03), (x0, y0 - 0.02), arrowprops=arrow)
    for wing, (x, y) in place.items():
        box(x, y, WIDTH, wing, "#e8f0f7")
    box(
        0,
        0,
        span - GAP_X,
        "base   geodesy   records   (below every wing)",
        "#d5e3ee",
    )
    axes.set_xlim(-span / 2, span / 2)
    axes.set_ylim(-0.15, (len(rows) + 1) * (HEIGHT + GAP_Y) - GAP_Y + 0.1)
    axes.set_aspect("equal")
    axes.axis("off")
    out.parent.mkdir(exist_ok=True)
    figure.savefig(out, bbox_inches="tight", metadata={"Date": None})
    print(out)


if __name__ == "__main__":
    main()
