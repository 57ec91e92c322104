"""The schema of the options: what is declared once is what reader, page, help and messages say."""

import argparse
import warnings
from dataclasses import dataclass
from pathlib import Path

import pytest

from insgnss.base.errors import InputError, OptionError
from insgnss.base.wording import spoken_as
from insgnss.config import document
from insgnss.config.block_file import BLOCK_TABLES
from insgnss.config.command_line import add_options, given_of, names_of
from insgnss.config.covariance import MODEL
from insgnss.config.flight_file import TABLES
from insgnss.config.keys.retired import retired_keys
from insgnss.config.kinds import PLAIN
from insgnss.config.load import known_keys, load_flight, read_covariance
from insgnss.config.ppk_options import EngineSettings
from insgnss.config.schema import check, declared, option, options_of
from insgnss.config.values import READERS

SPECS = Path(__file__).parents[2] / "data_specs"
PAGE, BLOCK_PAGE = SPECS / "flight_file.md", SPECS / "block_file.md"
READY = '[imu]\nfile = "imu.csv"\n[gnss]\nfile = "gnss.txt"\n'
RAW = READY.replace(
    'file = "gnss.txt"', 'rover = "imu.csv"\nbase = "imu.csv"\nnavigation = ["imu.csv"]'
)
ALL = [
    (f"{file}{name}", item, options_of(name, tables[name]))
    for file, tables in (("", TABLES), ("block:", BLOCK_TABLES))
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
    """Oracle: the pages themselves; `python -m insgnss.config.document` brings them up to date."""
    pages = [path.read_text(encoding="utf-8") for path in (PAGE, BLOCK_PAGE)]
    for page in pages:
        assert document.rendered(page) == page, "run python -m insgnss.config.document"
    assert all(f"<!-- rendered: {part} -->" in "".join(pages) for part in document.PARTS)


def test_a_page_that_is_behind_is_brought_up_to_date(tmp_path):
    """Oracle: the page; one row is taken out, one range is changed."""
    page = PAGE.read_text(encoding="utf-8")
    behind = page.replace("number, deg, 0 to 60", "number, deg, 0 to 90").replace(
        "| `gnss.ratio`", ""
    )
    (tmp_path / "page.md").write_text(behind, encoding="utf-8")
    document.main(tmp_path / "page.md")
    assert (tmp_path / "page.md").read_text(encoding="utf-8") == page


@pytest.mark.parametrize(
    ("item", "others"),
    [(item, others) for _, item, others in ALL],
    ids=[f"{name}.{item.name}" for name, item, _ in ALL],
)
def test_every_option_is_whole(item, others):
    """Oracle: the house rule: a meaning, a reader, a range the default lies in, no name twice."""
    assert len(item.option.meaning) > 5
    assert item.kind in READERS or item.kind == "tables"
    assert item.option.low < item.option.high
    if item.kind in ("number", "whole") and isinstance(item.default, int | float):
        assert item.option.low <= item.default <= item.option.high
    if item.choices and isinstance(item.default, str) and item.kind != "letters":
        assert item.default in item.choices
    names = [name for other in others for name in (other.name, *other.option.retired)]
    assert names.count(item.name) == 1
    assert document.value_words(item)
    assert document.default_words(item)


def test_every_reader_is_used():
    """Oracle: the declarations."""
    assert set(READERS) == {item.kind for _, item, _ in ALL} - {"tables"}
    assert set(PLAIN) < set(READERS)


def test_a_type_without_a_reader_is_refused():
    """Oracle: a table of our own."""

    @dataclass(frozen=True)
    class Odd:
        value: complex = option(0j, "no TOML value")

    with pytest.raises(TypeError, match="say by kind"):
        _ = declared(Odd)["value"].kind


def test_arguments_are_made_of_the_declarations():
    """Oracle: a table of our own."""

    @dataclass(frozen=True)
    class Table:
        angle_deg: float = option(
            15.0, "lowest angle", unit="deg", low=0.0, high=60.0, cli="--angle", metavar="DEG"
        )
        pair: tuple[float, float] = option((3.0, 1.0), "two numbers", cli="--pair")
        on: bool = option(True, "do it", cli="--off", cli_meaning="leave it")
        names: tuple[str, ...] = option((), "words at 50 %", cli="--names", retired=("words",))
        hidden: float = option(1.0, "of the file only")

    parser = argparse.ArgumentParser()
    add_options(parser, [Table])
    text = " ".join(parser.format_help().split())
    assert "--angle DEG lowest angle, deg, 0 to 60 (default: 15)" in text
    assert "two numbers (default: 3 1)" in text
    assert "words at 50 %" in text
    assert "hidden" not in text
    assert "--words" not in text
    assert given_of(parser.parse_args([]), Table) == {}
    words = ["--angle", "20", "--pair", "1", "2", "--off", "--names", "a", "--words", "b", "c"]
    with pytest.warns(FutureWarning, match="--words is called --names now"):
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
                "gnss.rtklib_options: pos1-elmask is not to be set there: gnss.elevation_mask_deg"
                " sets it"
            ),
            "--rtklib-options: pos1-elmask is not to be set there: --mask sets it",
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
    """Oracle: the tables by eye: sub-tables are known, retired names are not."""
    keys = known_keys()
    assert {"imu.units", "imu.further.units", "gnss.covariance.scale"} <= set(keys)
    assert "lever_m" not in keys["imu"]
    assert "further" not in keys["imu.further"]
    assert not {old for table, old, _ in retired_keys() if old in keys[table]}


RETIRED = {
    "imu.more": (READY + '[[imu.more]]\nfile = "imu.csv"\n', 5, lambda f: len(f.imu.further) == 1),
    "gnss.new_when": (READY + 'new_when = "c"\n', 5, lambda f: f.gnss.repeat_column == "c"),
    "gnss.calibrated": (
        READY + "calibrated = false\n",
        5,
        lambda f: not f.gnss.calibrate_covariance,
    ),
    "gnss.correlated": (READY + "correlated = 2.5\n", 5, lambda f: f.gnss.gm_sigma == 2.5),
    "gnss.uncorrelated": (READY + "uncorrelated = 0.5\n", 5, lambda f: f.gnss.white_scale == 0.5),
    "gnss.more": (
        RAW + "more = { pos1-b = 10 }\n",
        7,
        lambda f: f.gnss.raw.rtklib_options == {"pos1-b": "10"},
    ),
    "filter.wheels": (READY + "[filter]\nwheels = true\n", 6, lambda f: f.filter.non_holonomic),
    "gnss.covariance.hampered_s": (
        READY + "covariance = { hampered_s = 60 }\n",
        None,
        lambda f: f.gnss.covariance.degraded_s == 60.0,
    ),
    "gnss.covariance.scale.lone": (
        READY + "[gnss.covariance.scale]\nlone = 20\n",
        6,
        lambda f: f.gnss.covariance.scale["isolated"] == (20.0, 20.0, 20.0),
    ),
}


@pytest.mark.parametrize("key", RETIRED)
def test_a_retired_key_works_and_says_its_new_name(load, key):
    """Oracle: the vocabulary; the line is that of the old key."""
    text, line, holds = RETIRED[key]
    new = {f"{table}.{old}": f"{table}.{now}" for table, old, now in retired_keys()}[key]
    with pytest.warns(FutureWarning) as told:
        flight = load(text)
    assert holds(flight)
    (warning,) = told
    assert f"{key} is called {new} now" in str(warning.message)
    assert line is None or f"flight.toml:{line}: " in str(warning.message)


def test_both_names_of_a_key_are_refused(load):
    """Oracle: the line of the old one."""
    what = r"flight\.toml:6: gnss\.correlated: is the retired name of gnss\.gm_sigma"
    with pytest.raises(InputError, match=what):
        load(READY + "gm_sigma = 2\ncorrelated = 2\n")


def test_what_is_wrong_about_a_retired_key_is_told_at_its_line(load):
    """Oracle: line and key written by hand."""
    what = r"flight\.toml:5: gnss\.white_scale: 500 is outside 0\.01 to 100"
    with pytest.warns(FutureWarning), pytest.raises(InputError, match=what):
        load(READY + "uncorrelated = 500\n")


def test_a_covariance_file_takes_retired_names_as_well(tmp_path):
    """Oracle: the numbers of the file."""
    path = tmp_path / "c.toml"
    path.write_text("lone_satellites = 9\n[floor_m]\nweak = 20\n")
    with pytest.warns(FutureWarning) as told:
        model = read_covariance(path)
    assert len(told) == 2
    changes = {"unsupported_satellites": 9, "floor_m": {"unsupported": 20.0}}
    assert model == MODEL.with_changes(changes)


def test_present_names_are_silent(load):
    """Oracle: no warning at all."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load(READY + 'gm_sigma = "off"\nwhite_scale = 2\n[filter]\nnon_holonomic = true\n')
