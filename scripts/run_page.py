"""Run the commands of a page of the documentation, in their order, as a reader types them.

    python scripts/run_page.py docs/tutorials/own_arrays.md --out DIR [--pictures]

Blocks of ```sh and ```python are run one after the other in DIR; the first that fails ends it. A
page shows pictures by the names under which its commands leave them; with --pictures these are
reduced and put where the page looks for them, in docs/images.
"""

import argparse
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

WIDTH_PX = 1100


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    """Yield language and text of the page's blocks of ```sh and ```python, in order."""
    text = page.read_text(encoding="utf-8")
    yield from re.findall(r"^```(sh|python)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def pictures(page: Path) -> list[Path]:
    """Return the pictures that a page shows."""
    links = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text(encoding="utf-8"))
    return [(page.parent / link).resolve() for link in links]


def run(page: Path, out: Path) -> None:
    """Run all blocks of a page in a directory; the one that fails is named by its first line."""
    bin_directory = str(Path(sys.executable).parent)
    env = os.environ | {"PATH": os.pathsep.join([bin_directory, os.environ.get("PATH", "")])}
    for language, text in blocks(page):
        first = text.splitlines()[0]
        print(f"{page.name}: {first}", flush=True)
        shell = ["bash", "-euc", text] if language == "sh" else [sys.executable, "-c", text]
        done = subprocess.run(shell, cwd=out, env=env, check=False)
        if done.returncode:
            raise SystemExit(f"{page.name}: the block that begins with {first!r} failed")


def reduce_picture(source: Path, target: Path, width: int = WIDTH_PX) -> None:
    """Write a picture with at most `width` pixels across and 256 colours, as PNG."""
    from PIL import Image

    picture = Image.open(source).convert("RGB")
    if picture.width > width:
        picture = picture.resize(
            (width, round(picture.height * width / picture.width)), Image.Resampling.LANCZOS
        )
    picture.quantize(128, dither=Image.Dither.NONE).save(target, optimize=True)


def made_by(out: Path, name: str) -> Path:
    """Return the file of a name that the commands have left, wherever they left it."""
    made = sorted(out.rglob(name))
    if not made:
        raise SystemExit(f"the page shows {name}, which its commands have not made")
    return made[0]


def main() -> None:
    """Run the pages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("page", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True, help="a directory for each page in it")
    parser.add_argument("--pictures", action="store_true", help="replace those of the pages")
    options = parser.parse_args()
    for page in options.page:
        out = options.out / page.stem
        out.mkdir(parents=True)
        run(page.resolve(), out)
        for picture in pictures(page):
            made = made_by(out, picture.name)
            if options.pictures:
                reduce_picture(made, picture)
                print(f"wrote {picture}")


if __name__ == "__main__":
    main()
