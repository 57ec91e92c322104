"""season.csv, season.parquet and the page of a season."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from seasons import row

from insgnss.base.errors import InputError
from insgnss.batch.season.page import charts, is_ours, page_html, season_document
from insgnss.batch.season.row import (
    EQUIPMENT_FILE,
    ROW_COLUMNS,
    TEXT_COLUMNS,
    row_of,
    with_own_names,
)
from insgnss.batch.season.run import _relative, headline, line_of
from insgnss.batch.season.tables import csv_text, parquet_bytes, read_season
from insgnss.batch.season.trends import trends
from insgnss.batch.season.work import Outcome, Task, failed_outcome, not_reached

SPECS = Path(__file__).parents[3] / "data_specs"
REASON = 'gap, "quoted", <b>& 3 m'


def rows() -> list:
    rng = np.random.default_rng(1)
    made = [row(k, rng) for k in range(12)]
    for k, one in enumerate(made):
        one["lever_arm_forward_m"] += 1e-3 * k
    made[4] = failed_outcome(Task("f004", "f004/flight.toml"), REASON, 3, 0.1).row
    return made


def test_the_table_comes_back(tmp_path: Path) -> None:
    """Oracle: the rows, and Python's csv; nine digits."""
    path = tmp_path / "season.csv"
    path.write_text("".join(csv_text(rows())), encoding="utf-8")
    back = read_season(path)
    assert [one["name"] for one in back] == [f"f{k:03d}" for k in range(12)]
    assert back[4]["reason"] == REASON
    assert back[4]["lever_arm_forward_m"] is None
    for one, given in zip(back, rows(), strict=True):
        if given["status"] != "failed":
            assert one["lever_arm_right_m"] == pytest.approx(given["lever_arm_right_m"], rel=1e-8)
    head = next(csv.reader(path.read_text().splitlines()[1:]))
    assert tuple(head) == ROW_COLUMNS
    page = (SPECS / "season.md").read_text(encoding="utf-8")
    documented = [
        name
        for cell in re.findall(r"^\| (`.*?`) \|", page, re.MULTILINE)
        for name in re.findall(r"`(\w+)`", cell)
    ]
    assert tuple(documented) == ROW_COLUMNS


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name\nf1\n", r"season\.csv:1: is not a season\.csv"),
        ("# insgnss season 1\nname,images\nf1\n", r"season\.csv:3: 1 values under 2 columns"),
        *(
            (f"# insgnss season 1\nname,images\nf1,{x}\n", rf"season\.csv:3: images: '{x}' is no n")
            for x in ("x", "5%", "1_0", "nan", "inf", "\N{ARABIC-INDIC DIGIT ONE}2")
        ),
    ],
)
def test_what_is_no_season_is_refused(tmp_path: Path, text: str, message: str) -> None:
    """Oracle: the lines of the file."""
    (tmp_path / "season.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_season(tmp_path / "season.csv")


def test_parquet_holds_the_same() -> None:
    """Oracle: pyarrow's reader."""
    pq = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    import io

    table = pq.read_table(io.BytesIO(parquet_bytes(rows())))
    assert table.column_names == list(ROW_COLUMNS)
    assert table["reason"].to_pylist()[4] == REASON
    assert table["images"].to_pylist()[:5] == [3.0, 3.0, 3.0, 3.0, None]
    assert {table.schema.field(name).type for name in TEXT_COLUMNS} == {
        table.schema.field("name").type
    }


def test_the_page_puts_failures_first_and_links_reports(tmp_path: Path) -> None:
    """Oracle: the text of the page, in its order; a reason is no HTML."""
    text = "".join(page_html(season_document(rows(), trends(rows()), "12 flights")))
    assert "<b>&" not in text.partition("<script>")[0]
    order = ["1 of 12 flights have no result: f004", "Failed flights", "&lt;b&gt;&amp; 3 m"]
    order += ['href="f011/out/report.html"', "arm right of wing3 shows no drift"]
    positions = [text.index(words) for words in order]
    assert positions == sorted(positions)
    (tmp_path / "index.html").write_text(text)
    assert is_ours(tmp_path / "index.html")
    (tmp_path / "index.html").write_text("<html></html>")
    assert not is_ours(tmp_path / "index.html")
    made = {chart.name: chart for chart in charts(rows(), trends(rows()))}
    assert [len(chart.panels) for chart in made.values()] == [3, 1, 2]


def test_the_mood_follows_flights_and_trends() -> None:
    """Oracle: the rule: failures, contradictions, drift, doubtful flights, in that order."""
    rng = np.random.default_rng(2)
    good = [row(k, rng) for k in range(12)]
    assert season_document(good, trends(good), "h").verdict[0] == "good"
    doubtful = [*good[:-1], good[-1] | {"judgement": "doubtful"}]
    assert season_document(doubtful, (), "h").verdict[:2] == (
        "doubtful",
        "some figures of these flights are worse than those of a good flight: f011",
    )
    drifts = [one | {"lever_arm_down_m": 0.01 * k} for k, one in enumerate(good)]
    mood, why, _ = season_document(drifts, trends(drifts), "h").verdict
    assert (mood, "wing3 (antenna lever arm down)" in why) == ("doubtful", True)
    assert season_document(rows(), (), "h").verdict[0] == "bad"


def test_lines_say_what_became_of_a_flight() -> None:
    """Oracle: the rows."""
    done = Outcome("f1", "done", row(1, limits="attitude", judgement="doubtful"))
    assert line_of(done) == (
        "f1: done, 3 images, 3.0 / 3.0 / 3.0 mm (E, N, U), heading 0.010 deg, doubtful: attitude"
        " (1.2 s)"
    )
    broken = failed_outcome(Task("f2", "x"), "two\nlines", 3, 0.5)
    assert line_of(broken) == "f2: failed: two lines (0.5 s)"
    kept = Outcome("f3", "kept", row(3))
    assert headline([done, broken, kept]) == (
        "3 flights: 1 processed, 1 kept, with unchanged inputs, options and version, 1 failed;"
        " 6 images"
    )


def test_a_report_without_images_has_a_row() -> None:
    """Oracle: the report of a flight without a camera."""
    report = {
        "limits": [{"topic": "fixes", "rank": 1.5}, {"topic": "checks", "rank": 0.2}],
        "checks": [],
        "counts": {"images": 0, "fixes": 9, "fixes_used": 8},
        "span": {"gps_week": None, "start_tow_s": 0.0, "duration_s": 5.0},
        "flight": {"gps_week": 2000},
        "exposures": None,
        "use": {"verdict": "no", "sentence": "Do not use it", "reasons": ["why"]},
        "consistency": {"position": {"verdict": "consistent", "mean_per_dof": 1.1}},
        "versions": {"insgnss": "0.1.0"},
        "inputs_sha256": {"a": "b"},
        "constants": [
            {"name": "antenna lever arm right", "correction": 0.01, "sigma": 0.002, "assumed": 0.2}
        ],
    }
    made = row_of(report)
    assert made["nis_ratio"] == 1.1
    assert made["date_utc"] == "2018-05-05T23:59:42Z"
    assert made["lever_arm_right_m"] == pytest.approx(0.21)
    assert made["lever_arm_right_sigma_m"] == 0.002
    assert (made["limits"], made["images"], made["sigma_e_mm"]) == ("fixes", 0, None)


def test_equipment_files_of_one_name_are_several_equipments() -> None:
    """Oracle: the paths, by hand; what has a name of its own keeps it."""
    files = ["/s/a/wing3.toml", "/s/b/wing3.toml", "/s/b/wing3.toml", "/s/b/wing4.toml", ""]
    rows = [{"equipment": Path(file).stem, EQUIPMENT_FILE: file} for file in files]
    found = [row["equipment"] for row in with_own_names(rows)]
    assert found == ["a/wing3", "b/wing3", "b/wing3", "wing4", ""]


def test_reasons_name_files_as_the_table_does(tmp_path: Path) -> None:
    """Oracle: the path by hand; another directory's stays whole."""
    reason = f"{tmp_path}/f1/flight.toml:3: axes; see {tmp_path}x/readme"
    rows = [_relative(row(1, reason=reason), tmp_path)]
    assert rows[0]["reason"] == f"f1/flight.toml:3: axes; see {tmp_path}x/readme"


def test_a_flight_that_was_not_reached_has_a_row_that_says_what_to_do(tmp_path: Path) -> None:
    """Oracle: the table read back, and the headline by hand."""
    outcomes = [not_reached(Task("f1", "f1/flight.toml")), Outcome("f2", "done", row(2))]
    table = tmp_path / "season.csv"
    table.write_text("".join(csv_text([one.row for one in outcomes])))
    first, _ = read_season(table)
    assert (first["status"], first["images"]) == ("not reached", None)
    assert "give the same command again" in first["reason"]
    assert headline(outcomes).startswith("2 flights: 1 processed, 1 not reached; ")
