"""Which flights a season has, their names, and what is refused before anything runs."""

from pathlib import Path

import pytest

from insgnss.base.errors import InputError, InsgnssError, UsageError
from insgnss.batch.season.gathering import gather, refuse_shared_outputs


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Two flights in May, one in June, something else, and what a dead run left."""
    for name in ("may/f1", "may/f2", "june/f1", ".insgnss-1/new0"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "flight.toml").write_text("")
    (tmp_path / "may" / "wing.toml").write_text("")
    return tmp_path


def names(*words: object) -> list[str]:
    return [flight.name for flight in gather([str(word) for word in words])]


def test_directories_patterns_and_files_name_flights(tree: Path) -> None:
    """Oracle: the tree, read by eye; a flight that two words name counts once."""
    assert names(tree) == ["june/f1", "may/f1", "may/f2"]
    assert names(tree / "may") == ["f1", "f2"]
    assert names(tree / "*" / "f1") == ["june/f1", "may/f1"]
    assert names(tree / "**" / "flight.toml") == ["june/f1", "may/f1", "may/f2"]
    assert names(tree / "may" / "f1" / "flight.toml") == ["f1"]
    assert names(tree / "may", tree / "may" / "f1", tree / "june") == [
        "may/f1",
        "may/f2",
        "june/f1",
    ]


def test_a_table_gives_names_and_outputs(tree: Path) -> None:
    """Oracle: the table; paths are relative to it."""
    table = tree / "flights.csv"
    table.write_text("flight,name,out\nmay/f1,first,out/1\njune/f1/flight.toml,,\n")
    first, second = gather([str(table)])
    assert (first.name, first.out) == ("first", tree / "out" / "1")
    assert (second.name, second.out) == ("june/f1", None)


def test_outputs_of_a_table_lie_below_it_or_below_the_overview(
    tree: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Oracle: the rule of `insgnss batch --help`; symbolic links are followed."""
    over = tmp_path_factory.mktemp("over")
    (tree / "away").symlink_to(over)
    for out in (f"../{over.name}/1", str(over / "1"), "away/1"):
        table = tree / "flights.csv"
        table.write_text(f"flight,out\nmay/f1,{out}\n")
        with pytest.raises(InputError, match=r"flights\.csv:2: out '.*' is outside .*set --out"):
            gather([str(table)], tree)
        (flight,) = gather([str(table)], over)
        assert flight.out == tree / out


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,out\na,b\n", r"flights\.csv:1: has no column flight \(columns: name, out\)"),
        ("flight,oot\nmay/f1,b\n", r"flights\.csv:1: column 'oot' is unknown; known are flight"),
        ("flight,out\nmay/f1\n", r"flights\.csv:2: 1 values under 2 columns"),
        ("# a\nflight,out\n# b\nmay/f1\n", r"flights\.csv:4: 1 values under 2 columns"),
        ("# a\n\nname\na\n", r"flights\.csv:3: has no column flight"),
        ("flight\nmay/f9\n", r"flights\.csv:2: flight 'may/f9' does not exist"),
        ("flight\n", r"flights\.csv: names no flight"),
        ("", r"flights\.csv:1: has no column flight \(columns: none\)"),
    ],
)
def test_a_wrong_table_is_refused_at_its_line(tree: Path, text: str, message: str) -> None:
    """Oracle: the lines of the table."""
    (tree / "flights.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        gather([str(tree / "flights.csv")])


def test_what_names_no_flight_is_refused(tree: Path) -> None:
    """Oracle: the tree."""
    (tree / "empty").mkdir()
    for word, message in (
        ("empty", "no flight.toml in this directory or below it"),
        ("july", "does not exist; give directories"),
        ("july/*", "the pattern matches nothing"),
        ("may/f1/*.csv", "the pattern matches nothing"),
    ):
        with pytest.raises(UsageError, match=message):
            gather([str(tree / word)])


def test_two_of_one_name_or_one_output_are_refused(tree: Path) -> None:
    """Oracle: a table that says so, and a link to a directory."""
    table = tree / "flights.csv"
    table.write_text("flight,name\nmay/f1,a\nmay/f2,a\n")
    with pytest.raises(InsgnssError, match="two flights are called 'a'"):
        gather([str(table)])
    (tree / "link").symlink_to(tree / "may")
    with pytest.raises(UsageError, match="a and b have the same output directory"):
        refuse_shared_outputs([("a", tree / "may" / "out"), ("b", tree / "link" / "out")])
