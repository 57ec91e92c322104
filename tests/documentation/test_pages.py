"""Pages of the documentation: links, pictures, tutorials that run, the site that builds."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from oracles import oracle

import insgnss

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
TUTORIALS = sorted((DOCS / "tutorials").glob("*.md"))
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]


def prose(page: Path) -> str:
    """Text of a page without its blocks of code."""
    return re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)


NUMBER = r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
RELATIVE = 0.05  # what compilers and libraries may move; more is another result


def words_of(line: str) -> str:
    """The words of a line, with # for its numbers."""
    return " ".join(re.sub(NUMBER, "#", line).split())


def same_figures(quoted: str, printed: str) -> bool:
    """Whether two lines of the same words agree: counts equal, else to 5 % or a last digit."""
    estimates = {match.start() for match in re.finditer(rf"{NUMBER}(?= \+- )", quoted)}
    estimates |= {match.end() for match in re.finditer(r" \+- ", quoted)}
    for one, other in zip(re.finditer(NUMBER, quoted), re.finditer(NUMBER, printed), strict=False):
        decimals = one.group().partition(".")[2]
        if not decimals and one.start() not in estimates:
            allowed = 0.0
        else:
            allowed = max(RELATIVE * abs(float(one.group())), 1.01 * 10.0 ** -len(decimals))
        if abs(float(one.group()) - float(other.group())) > allowed:
            return False
    return True


def contradicted(page: str, output: str) -> list[str]:
    """Lines that a page quotes as printed, or figures of its tables, which the output has not."""
    lines = output.splitlines()
    wrong = []
    for block in re.findall(r"^```text\n(.*?)^```", page, re.M | re.S):
        for quoted in filter(str.strip, block.splitlines()):
            start = quoted.removesuffix("...").rstrip()
            words = words_of(start)
            same = [
                line
                for line in lines
                if (
                    words_of(line).startswith(words) if start != quoted else words_of(line) == words
                )
            ]
            if not any(same_figures(start, line) for line in same):
                wrong.append(quoted)
    pairs = re.findall(r"([\d.]+) deg, ([\d.]+) sigmas", page)
    if pairs:
        rows = [line.split() for line in lines if re.match(r" +about \w+ .* deg +[\d.]+$", line)]
        for (rms, ratio), row in zip(pairs, rows, strict=True):
            quoted = f"{rms} deg, {ratio} sigmas"
            if not same_figures(quoted, f"{row[-5]} deg, {row[-1]} sigmas"):
                wrong.append(quoted)
    return wrong


@pytest.mark.parametrize(
    ("output", "lines"),
    [
        ("158 images: 3.1 mm, 24.983 +- 0.014\n  about up 0 0 0 0.0419 0 0 deg 1.17", 0),
        ("158 images: 3.2 mm, 24.1 +- 0.014\n  about up 0 0 0 0.0419 0 0 deg 1.17", 0),
        ("157 images: 3.1 mm, 24.983 +- 0.014\n  about up 0 0 0 0.0419 0 0 deg 1.17", 1),
        ("158 images: 3.1 mm, 22.983 +- 0.014\n  about up 0 0 0 0.0419 0 0 deg 1.17", 1),
        ("158 images: 3.1 cm, 24.983 +- 0.014\n  about up 0 0 0 0.0419 0 0 deg 1.17", 1),
        ("158 images: 3.1 mm, 24.983 +- 0.014\n  about up 0 0 0 0.0519 0 0 deg 1.17", 1),
        ("158 images: 3.1 mm, 24.983 +- 0.014\n  about up 0 0 0 0.0419 0 0 deg 1.57", 1),
    ],
)
def test_figures_that_the_commands_do_not_print_are_noticed(output: str, lines: int) -> None:
    """Oracle: a page of two figures, and outputs of which we know whether they agree."""
    page = "```text\n158 images: 3.1 mm, 24.983 +- 0.014\n```\n| up | 0.042 deg, 1.17 sigmas |\n"
    assert len(contradicted(page, output)) == lines


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub and the site form them."""
    heads = re.findall(r"^#+ +(.*)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).strip().replace(" ", "-") for head in heads}


def test_links_within_the_pages_lead_somewhere() -> None:
    """Oracle: the directory's listing, and the headings of the page that is linked to."""
    for page in PAGES:
        for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
            if re.match(r"[a-z]+:", target):
                continue
            name, _, anchor = target.partition("#")
            path = (page.parent / name).resolve() if name else page
            assert path.exists(), f"{page.relative_to(ROOT)}: no {target}"
            if anchor:
                assert anchor in anchors(path), f"{page.relative_to(ROOT)}: no {target}"


def test_every_page_is_reached_from_the_first() -> None:
    """Oracle: the listing of docs/, against the tables of contents."""
    contents = "\n".join(page.read_text(encoding="utf-8") for page in DOCS.rglob("*.md"))
    entries = re.findall(r"^```\{toctree\}\n(.*?)^```", contents, re.M | re.S)
    reached = {Path(line).name for entry in entries for line in entry.split() if line[0] != ":"}
    assert {page.stem for page in DOCS.rglob("*.md")} - {"index"} <= reached


def test_the_readme_is_short_and_has_one_picture() -> None:
    """Oracle: the limits of 900 words and 150 kB."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.split()) < 900
    (picture,) = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", text)
    assert (ROOT / picture).stat().st_size < 150_000


def test_pictures_are_shown_described_and_small() -> None:
    """Oracle: the listing of docs/images; a picture without words is none to who cannot see it."""
    shown = set()
    for page in PAGES:
        for words, target in re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", prose(page)):
            assert words, f"{page.relative_to(ROOT)}: {target} has no description"
            shown.add((page.parent / target).resolve())
    images = set((DOCS / "images").iterdir())
    assert images <= shown
    assert all(path.stat().st_size < 200_000 for path in images)


def test_the_page_of_the_api_has_every_public_name() -> None:
    """Oracle: `insgnss.__all__`."""
    text = (DOCS / "reference" / "api.md").read_text(encoding="utf-8")
    assert set(re.findall(r"auto\w+:: insgnss\.(\w+)", text)) == set(insgnss.__all__) - {
        "__version__"
    }


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the blocks are of a POSIX shell")
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_tutorials_run_and_end_in_their_pictures(
    page: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Oracle: the page; its figures are printed, its pictures made of the same shape, not blank."""
    from PIL import Image

    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    from run_page import blocks, made_by, pictures, run

    if "oracles" in page.read_text(encoding="utf-8"):
        oracle("gtsam")
    assert len(list(blocks(page))) >= 3
    assert len(pictures(page)) >= 1
    run(page, tmp_path)
    assert not contradicted(page.read_text(encoding="utf-8"), capfd.readouterr().out)
    for picture in pictures(page):
        made = Image.open(made_by(tmp_path, picture.name)).convert("L")
        shown = Image.open(picture).convert("L")
        assert made.width / made.height == pytest.approx(shown.width / shown.height, rel=0.02)
        dark = sum(made.histogram()[:128]) / (made.width * made.height)
        assert 0.001 < dark < 0.5


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    """Oracle: Sphinx with warnings as errors: links, anchors, docstrings, tables of contents."""
    for name in ("sphinx", "furo", "myst_parser"):
        pytest.importorskip(name, reason="pip install '.[docs]'", exc_type=ImportError)
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-c", str(DOCS)]
    done = subprocess.run(
        [*command, "-d", str(tmp_path / "trees"), "-b", "html", str(ROOT), str(tmp_path / "site")],
        capture_output=True,
        text=True,
        check=False,
        timeout=500,
    )
    assert done.returncode == 0, done.stderr
    verbs = (tmp_path / "site" / "docs" / "reference" / "commands.html").read_text("utf-8")
    assert "--imu-rate HZ" in verbs
    api = (tmp_path / "site" / "docs" / "reference" / "api.html").read_text("utf-8")
    assert 'id="insgnss.estimate"' in api
    assert (tmp_path / "site" / "data_specs" / "flight_file.html").exists()
