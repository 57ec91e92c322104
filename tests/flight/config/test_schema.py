"""The schema of the options: what is declared once is what reader, page, help and messages say."""

import argparse
import importlib
import subprocess
import sys
from dataclasses import dataclass, is_dataclass
from pathlib import Path

import pytest
import render_options

from insgnss.base.errors import OptionError
from insgnss.base.wording import spoken_as
from insgnss.cli import build_parser
from insgnss.cli.adjust import block_of
from insgnss.flight.config.block_file import BLOCK_TABLES
from insgnss.flight.config.command_line import add_options, given_of, names_of
from insgnss.flight.config.flight_file import FLIGHT_TABLES
from insgnss.flight.config.load import load_flight
from insgnss.flight.config.values import VALUE_READERS, known_keys
from insgnss.gnss.ppk_options import EngineSettings
from insgnss.io.options.kinds import OPTION_KINDS, check
from insgnss.io.options.schema import declared_options, option, options_of

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "data_specs" / "flight_file.md"
READY = '[imu]\nfile = "imu.csv"\n[gnss]\nfile = "gnss.txt"\n'
RAW = READY.replace(
    'file = "gnss.txt"', 'rover = "imu.csv"\nbase = "imu.csv"\nnavigation = ["imu.csv"]'
)
VERBS = ("compare", "tune", "calibrate.mounting")
ALL = [
    (f"{file}{name}", item, options_of(name, tables[name]))
    for file, tables in (("", FLIGHT_TABLES), ("block:", BLOCK_TABLES))
    for name in tables
    for item in options_of(name, tables[name])
]


@pytest.fixture
def load(tmp_path):
    """Writes a flight file beside the files that it may name, and loads it."""
    for name in ("imu.csv", "gnss.txt"):
        (tmp_path / name).write_text("1 2 3\n")

    def write_and_load(text):
        (tmp_path / "flight.toml").write_text(text)
        return load_flight(tmp_path)

    return write_and_load


def test_the_pages_are_rendered_from_the_schema():
    """Oracle: the pages themselves; `python scripts/render_options.py` brings them up to date."""
    pages = [path.read_text(encoding="utf-8") for path in map(ROOT.joinpath, render_options.PAGES)]
    for page in pages:
        assert render_options.rendered(page) == page, "run python scripts/render_options.py"
    assert all(f"<!-- rendered: {part} -->" in "".join(pages) for part in render_options.PARTS)


def test_a_page_that_is_behind_is_brought_up_to_date(tmp_path):
    """Oracle: the page; one row is taken out, one range is changed."""
    page = PAGE.read_text(encoding="utf-8")
    behind = page.replace("number, deg, 0 to 60", "number, deg, 0 to 90").replace(
        "| `gnss.ratio`", ""
    )
    (tmp_path / "page.md").write_text(behind, encoding="utf-8")
    render_options.main(tmp_path / "page.md")
    assert (tmp_path / "page.md").read_text(encoding="utf-8") == page


@pytest.mark.parametrize("table", dict.fromkeys(name for name, _, _ in ALL))
def test_every_option_is_whole(table):
    """Oracle: the house rule: a meaning, a reader, a range the default lies in, no name twice."""
    for item, others in ((item, others) for name, item, others in ALL if name == table):
        assert len(item.option.meaning) > 5, item.name
        assert item.kind in OPTION_KINDS, item.name
        assert item.option.low < item.option.high, item.name
        if item.kind in ("number", "whole") and isinstance(item.default, int | float):
            assert item.option.low <= item.default <= item.option.high, item.name
        if item.choices and isinstance(item.default, str) and item.kind != "letters":
            assert item.default in item.choices, item.name
        assert [other.name for other in others].count(item.name) == 1
        assert render_options.value_words(item), item.name
        assert render_options.default_words(item), item.name


def test_every_kind_is_used():
    """Oracle: the declarations, those of the verbs among them."""
    verbs = [importlib.import_module(f"insgnss.cli.{name}") for name in VERBS]
    records = [kind for module in verbs for kind in vars(module).values() if is_dataclass(kind)]
    of_verbs = {item.kind for kind in records for item in declared_options(kind).values()}
    assert set(OPTION_KINDS) == {item.kind for _, item, _ in ALL} | of_verbs
    assert set(VALUE_READERS) < set(OPTION_KINDS)


def test_a_type_without_a_reader_is_refused():
    """Oracle: a table of our own."""

    @dataclass(frozen=True)
    class Odd:
        value: complex = option(0j, "no TOML value")

    with pytest.raises(TypeError, match="say by kind"):
        _ = declared_options(Odd)["value"].kind


def test_arguments_are_made_of_the_declarations():
    """Oracle: a table of our own."""

    @dataclass(frozen=True)
    class Table:
        angle_deg: float = option(
            15.0, "lowest angle", unit="deg", low=0.0, high=60.0, cli="--angle", metavar="DEG"
        )
        pair: tuple[float, float] = option((3.0, 1.0), "two numbers", cli="--pair")
        on: bool = option(True, "do it", cli="--off", cli_meaning="leave it")
        names: tuple[str, ...] = option((), "words at 50 %", cli="--names")
        hidden: float = option(1.0, "of the file only")

    parser = argparse.ArgumentParser()
    add_options(parser, [Table])
    text = " ".join(parser.format_help().split())
    assert "--angle DEG lowest angle, deg, 0 to 60 (default: 15)" in text
    assert "two numbers (default: 3 1)" in text
    assert "words at 50 %" in text
    assert "hidden" not in text
    assert given_of(parser.parse_args([]), Table) == {}
    words = ["--angle", "20", "--pair", "1", "2", "--off", "--names", "a", "b", "c"]
    found = given_of(parser.parse_args(words), Table)
    assert found == {"angle_deg": 20.0, "pair": (1.0, 2.0), "on": False, "names": ("a", "b", "c")}


@pytest.mark.parametrize(
    ("values", "of_the_file", "of_the_verb"),
    [
        (
            {"max_age_s": 9e3},
            "gnss.max_age_s = 9000.0: must be 0.01 to 3600",
            "--max-age 9000.0: must be",
        ),
        ({"max_age_s": float("nan")}, "gnss.max_age_s = nan: must be", "--max-age nan: must be"),
        (
            {"frequencies": 4},
            "gnss.frequencies = 4: must be 1, 2 or 3",
            "--frequencies 4: must be 1, 2 or 3",
        ),
        (
            {"systems": "GX"},
            "gnss.systems = 'GX': must be letters of GREJC",
            "--systems GX: must be",
        ),
        (
            {"base_point": "pole"},
            "gnss.base_point = 'pole': must be apc, arp or marker",
            "--base-point pole: must",
        ),
        (
            {"acceleration_mps2": (3.0, 0.0)},
            "gnss.acceleration_mps2 = (3.0, 0.0): must",
            "--acceleration 3.0 0.0: must",
        ),
        (
            {"rtklib_options": {"pos1-elmask": "10"}},
            (
                "gnss.rtklib_options: pos1-elmask cannot be set there: gnss.elevation_mask_deg"
                " sets it"
            ),
            "--rtklib-options: pos1-elmask cannot be set there: --mask sets it",
        ),
    ],
)
def test_an_error_carries_its_key_and_speaks_as_the_caller(values, of_the_file, of_the_verb):
    """Oracle: sentences written by hand."""
    with pytest.raises(OptionError) as plain:
        EngineSettings(**values)
    assert plain.value.key == f"gnss.{next(iter(values))}"
    assert str(plain.value).startswith(of_the_file)
    with spoken_as(names_of()), pytest.raises(OptionError) as spoken:
        EngineSettings(**values)
    assert str(spoken.value).startswith(of_the_verb)


def test_values_in_range_pass():
    """Oracle: the ends of the ranges, which are allowed."""
    for values in (
        {"max_age_s": 0.01},
        {"max_age_s": 3600.0},
        {"systems": "G"},
        {"frequencies": 3},
    ):
        check(EngineSettings(**values), "gnss")


def test_unknown_keys_find_their_way():
    """Oracle: the tables by eye: sub-tables are known."""
    keys = known_keys(FLIGHT_TABLES)
    assert {"imu.units", "imu.further.units", "gnss.covariance.scale"} <= set(keys)
    assert "lever_m" not in keys["imu"]
    assert "further" not in keys["imu.further"]


def test_every_option_of_a_block_reaches_it(tmp_path):
    """Oracle: the words of the command line; --pose-covariance was lost beside an eo.json."""
    (tmp_path / "eo.json").write_text("{}")
    (tmp_path / "points.csv").write_text("x")
    words = (
        f"adjust {tmp_path}/eo.json --images {tmp_path}/points.csv --pose-covariance --mode direct"
        " --position-sigma 0.01 0.01 0.02 --shift-sigma 0.1 0.1 0.2 --readout 0.03 --tables"
    )
    block = block_of(build_parser().parse_args(words.split()))
    assert block.output.pose_covariance
    assert block.output.directory == tmp_path / "adjusted"
    assert block.output.tables
    assert block.adjustment.mode == "direct"
    assert block.aerial_control.sigma_m == (0.01, 0.01, 0.02)  # was none of any form
    assert block.aerial_control.shift_sigma_m == (0.1, 0.1, 0.2)
    assert block.camera.readout_s == 0.03


def test_whole_numbers_of_a_file_are_kept_as_the_option_is_declared(load):
    """Oracle: the annotations; reports write 10.0 and 10 otherwise."""
    text = RAW + "elevation_mask_deg = 10\nacceleration_mps2 = [3, 1]\n"
    raw = load(text + "atmosphere = { humidity = 1 }\nfrequencies = 1.0\n").gnss.raw
    numbers = (raw.elevation_mask_deg, *raw.acceleration_mps2, raw.atmosphere["humidity"])
    assert [type(number) for number in numbers] == [float] * 4
    assert type(raw.frequencies) is int


def test_options_of_a_sensor_are_checked_by_themselves() -> None:
    """Oracle: a new process, in which nothing else has registered the kinds of options."""
    call = 'MeasurementInput(kind="heading", file="heading.csv")'
    code = f"from insgnss.flight.sensors.options import MeasurementInput; {call}"
    subprocess.run([sys.executable, "-c", code], check=True)
