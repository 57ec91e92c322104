"""`insgnss inspect` of a directory with RINEX: what it holds, which receiver flew, its PPK."""

import json
import tomllib

import numpy as np
import pytest
from scripted_engine import navigation
from written_rinex import header2, record

from insgnss.cli import main
from insgnss.flight.inspection.rinex.survey import survey
from insgnss.flight.inspection.run import inspect_files

PLACE = record(f"{4363530.0:14.4f}{499341.7:14.4f}{4610232.8:14.4f}", "APPROX POSITION XYZ")
ANTENNA = record(f"{'1':20}{'LEIAR10         NONE':20}", "ANT # / TYPE")
EVENT = " 18 10  4 13  5 {:10.7f}  5  0\n"


def receiver(path, marker, times, events=(), more=""):
    """A file of a satellite in two bands at seconds of 13 h 5 min."""
    head = header2(("C1", "L1", "L2"), more + ANTENNA).replace("rover", f"{marker:5}", 1)
    rows = [
        (t, f" 18 10  4 13  5{t:11.7f}  0  1G05\n{2e7:14.3f}  {1e8:14.3f}  {8e7:14.3f}\n")
        for t in times
    ]
    rows += [(t, EVENT.format(t)) for t in events]
    path.write_text(head + "".join(text for _, text in sorted(rows)))
    return path


@pytest.fixture
def flown(tmp_path):
    """A rover with events and two files of a base."""
    place = tmp_path / "set"
    place.mkdir()
    receiver(place / "r.18o", "R", np.arange(10.0, 40.0), (12.3, 20.1))
    for k in range(2):
        receiver(place / f"b{k}.18o", "B", np.arange(30.0 * k, 30.0 * k + 30.0), more=PLACE)
    (place / "n.18n").write_text(navigation())
    return place


def test_receivers_and_their_parts(flown):
    """Oracle: what was written, by hand."""
    s = survey([flown])
    assert [[file.name for file in one.files] for one in s.receivers] == [
        ["b0.18o", "b1.18o"],
        ["r.18o"],
    ]
    base = s.base
    assert (base.epochs, base.interval_s, base.gaps, base.events) == (60, 1.0, 0, 0)
    assert base.bands == {"G": ("1", "2")}
    assert "LEIAR10 NONE" in base.described
    assert s.rover.events == 2
    assert s.why == "only its file has camera events"
    assert s.missing == ""


def test_the_draft_solves_it(flown, capsys):
    """Oracle: TOML's own reader; the base's place is left for a person to say."""
    assert main(["inspect", str(flown), "--write", str(flown / "flight.toml")]) == 0
    out = capsys.readouterr().out
    assert (
        f"next: insgnss ppk {flown / 'r.18o'} --base {flown / 'b0.18o'} {flown / 'b1.18o'}" in out
    )
    text = (flown / "flight.toml").read_text()
    gnss = tomllib.loads(text)["gnss"]
    assert gnss == {"rover": "r.18o", "base": ["b0.18o", "b1.18o"], "navigation": ["n.18n"]}
    assert "# base_position = [46.5" in text


def test_a_rover_without_events_is_the_one_of_more_epochs(tmp_path):
    """Oracle: rates by hand; of two receivers alike nothing is guessed."""
    receiver(tmp_path / "a.18o", "A", np.arange(0.0, 40.0, 0.5))
    receiver(tmp_path / "b.18o", "B", np.arange(0.0, 40.0))
    assert survey([tmp_path]).rover.files[0].name == "a.18o"
    receiver(tmp_path / "a.18o", "A", np.arange(0.0, 40.0))
    s = survey([tmp_path])
    assert s.rover is None
    assert "the files do not show which receiver of a.18o, b.18o flew" in s.missing


def test_what_is_missing_is_named(flown, capsys):
    """Oracle: exit code 4 and one line."""
    (flown / "n.18n").unlink()
    assert main(["inspect", str(flown), "--json"]) == 4
    assert "a navigation file" in json.loads(capsys.readouterr().out)["missing"]
    (flown / "r.18o").unlink()
    result = inspect_files([flown])
    assert "the observations are of one receiver" in result.missing
    assert result.refusal.exit_code == 4


def test_samples_beside_rinex_become_a_flight(flown):
    """Oracle: the keys of both; a recording of samples without fixes was refused."""
    rng = np.random.default_rng(2)
    rows = [
        "{:.3f},{:.6f},{:.6f},{:.6f},{:.5f},{:.5f},{:.5f}".format(
            392700.0 + 0.01 * k, *0.001 * rng.standard_normal(3), *rng.normal([0, 0, -9.81], 0.02)
        )
        for k in range(3000)
    ]
    head = "tow[s],gx[rad/s],gy[rad/s],gz[rad/s],ax[m/s^2],ay[m/s^2],az[m/s^2]"
    (flown / "imu.csv").write_text("\n".join([head, *rows]) + "\n")
    result = inspect_files([flown])
    assert result.missing == ""
    tables = tomllib.loads(result.draft.text(flown))
    assert (tables["imu"]["file"], tables["gps_week"]) == ("imu.csv", 2021)
    assert tables["gnss"]["base"] == ["b0.18o", "b1.18o"]
