"""One flight in a worker: when it is processed, when it is kept, and what its failure is."""

import json
from pathlib import Path

import pytest
from seasons import short_flight

from insgnss.batch.season.archive import examine_archive
from insgnss.batch.season.run import forecast_bytes
from insgnss.batch.season.work import FAILED, Outcome, Task, is_changed, process_task

pytestmark = pytest.mark.slow
IMU = "01_Observations/IMU/Data/Pre_calibrated/f8_1_sob.csv"
OUT = Path("02_Processed/GPS-INS")


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return short_flight(tmp_path_factory.mktemp("work"))


def run(flight: Path, **options: bool) -> Outcome:
    return process_task(Task("f", str(flight / "flight.toml"), **options))


def changed(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_it_is_kept_as_long_as_nothing_has_changed(flight: Path) -> None:
    """Oracle: the status, and the time stamp of the report. An option of the flight file, one of
    its equipment, a value of an input, a product that is gone, another version, and --again each
    have it processed once.
    """
    report = flight / OUT / "report.json"
    assert run(flight).status == "done"
    written = report.stat().st_mtime_ns
    assert run(flight).status == "kept"
    assert report.stat().st_mtime_ns == written
    assert run(flight, again=True).status == "done"
    for change in (
        lambda: changed(flight / "flight.toml", "[gnss]", "[gnss]\ngate_sigma = 6"),
        lambda: changed(flight.parent / "wing3.toml", "antenna_m = [0.462", "antenna_m = [0.463"),
        lambda: changed(flight.parent / "wing3.toml", "[mounting]", "# same\n[mounting]"),
        lambda: changed(flight / IMU, "\n", "\n\n"),
        lambda: (flight / OUT / "metashape.csv").unlink(),
        lambda: changed(report, '"insgnss":', '"insgnss": "0.0.1", "other":'),
        lambda: report.write_text("{"),
    ):
        change()
        assert run(flight, force=True).status == "done"
        assert run(flight).status == "kept"


def test_a_product_that_was_changed_is_named_and_kept(flight: Path) -> None:
    """Oracle: what was changed; that --again writes it anew; what `archive` says of it."""
    product = flight / OUT / "metashape.csv"
    run(flight, force=True)
    assert not is_changed(run(flight).row)
    written = product.read_bytes()
    product.write_bytes(written + b"# mine\n")
    again = run(flight)
    assert again.status == "kept"
    assert is_changed(again.row)
    assert "products changed after the run wrote them, and kept: metashape.csv" in again.reason
    assert "--again" in again.reason
    assert product.read_bytes() == written + b"# mine\n"
    said = str(examine_archive(flight, False, lambda *_: None))
    assert "metashape.csv was changed after the run wrote it" in said
    assert not is_changed(run(flight, again=True).row)
    assert product.read_bytes() == written


@pytest.mark.parametrize("force", [False, True])
def test_a_broken_file_is_told_where_there_are_results(flight: Path, force: bool) -> None:
    """Oracle: the line that was broken; `--force` is no remedy for it, and is one for others."""
    run(flight, force=True)
    file = flight / IMU
    whole = file.read_text()
    lines = whole.splitlines(keepends=True)
    try:
        file.write_text("".join([*lines[:1000], "205201.5,oops,0,0,0,0,-9.8\n", *lines[1000:]]))
        broken = run(flight, force=force)
        assert broken.status == "failed"
        assert ":1001" in broken.reason
        assert "--force" not in broken.reason
        file.write_text("".join(lines[:-1]))
        assert ("--force" in run(flight, force=force).reason) == (not force)
    finally:
        file.write_text(whole)
        run(flight, force=True)


def test_the_row_is_that_of_the_report(flight: Path) -> None:
    """Oracle: report.json, and the lever arm of the simulation, (0.462 - 0.113) m along the
    camera's x, within four sigmas.
    """
    outcome = run(flight)
    report = json.loads((flight / OUT / "report.json").read_text())
    row = outcome.row
    assert row["images"] == report["counts"]["images"] > 0
    assert row["sigma_u_mm"] == report["exposures"]["position_mm"]["median"][2]
    assert row["equipment"] == "wing3"
    assert abs(row["lever_arm_forward_m"] + 0.349) < 4 * row["lever_arm_forward_sigma_m"] < 0.05
    assert row["boresight_x_deg"] == pytest.approx(-0.657, abs=1e-3)
    assert row["boresight_x_sigma_deg"] is None
    assert Path(row["report"]).is_file()
    assert 3e8 < forecast_bytes_of(flight) < 2e9


def forecast_bytes_of(flight: Path) -> float:
    from insgnss.flight.config.load import load_flight

    return forecast_bytes(load_flight(flight))


def test_a_failure_is_the_line_of_process(flight: Path, tmp_path: Path) -> None:
    """Oracle: exit codes of the design: 3 bad input, 1 a defect."""
    missing = process_task(Task("f", str(tmp_path / "flight.toml")))
    assert (missing.status, missing.exit_code) == (FAILED, 3)
    assert "does not exist" in missing.reason
    (tmp_path / "flight.toml").write_text("[imu]\nfile = 3\n")
    wrong = process_task(Task("f", str(tmp_path / "flight.toml")))
    assert wrong.exit_code == 3
    assert "flight.toml:2: imu.file: 3 is a number, expected a text" in wrong.reason


def test_an_archive_is_made_again_byte_for_byte(flight: Path) -> None:
    """Oracle: hashes of the first run; then a flight file that says otherwise than the run did."""
    assert run(flight).status == "kept"
    (result,) = examine_archive(flight, True, lambda _: None).runs
    assert (result.problems, result.remade) == ((), True)
    report = flight / OUT / "report.json"
    text = report.read_text()
    changed(report, '"gate_sigma": 6', '"gate_sigma": 7')
    (result,) = examine_archive(flight, False, lambda _: None).runs
    assert "the flight file alone gives other values of gnss" in result.problems[0]
    report.write_text(text)
