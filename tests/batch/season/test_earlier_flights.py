"""A flight compared with the earlier ones of its equipment: what is planted is named, no more."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import seasons

import insgnss
from insgnss.batch.season import earlier
from insgnss.batch.season.row import BIAS_COLUMNS
from insgnss.batch.season.tables import csv_text

BIAS_SPREAD = 2.0  # deg/h and mg, from one turn-on to the next


def with_biases(k: int, rng: np.random.Generator, **values: Any) -> dict[str, Any]:
    biases = {column: BIAS_SPREAD * float(rng.normal()) for column in BIAS_COLUMNS}
    return seasons.row(k, rng, **biases) | values


def compared(directory: Path, monkeypatch, this: dict[str, Any], *before: dict[str, Any]) -> Any:
    """What a flight in `directory` finds in the season.csv above it."""
    (directory / "season.csv").write_text("".join(csv_text([*before, this])))
    monkeypatch.setattr(earlier, "row_of", lambda report: dict(this))
    monkeypatch.setattr(earlier, "boresight_of", lambda flight: {})
    equipment, file = directory / "wing3.toml", directory / "f009" / "flight.toml"
    flight: Any = SimpleNamespace(included=(equipment,), path=file)
    return earlier.earlier_flights(flight, {}).get("earlier")


@pytest.mark.parametrize(
    ("planted", "names"),
    [
        ({}, []),
        ({"lever_arm_right_m": 0.15}, ["antenna lever arm right"]),
        ({"time_offset_s": 0.004}, ["GNSS time offset"]),
        (
            {"sigma_u_mm": 5.0, "nis_ratio": 0.5},
            ["sigma U", "NIS of position per degree of freedom"],
        ),
        ({"gyro_bias_down_deg_h": 40.0}, ["gyro bias down"]),
        ({"accel_bias_right_mg": -30.0}, ["accel bias right"]),
    ],
    ids=str,
)
def test_what_is_planted_is_named_alone(tmp_path, monkeypatch, planted, names) -> None:
    """Oracle: the difference that was planted in the ninth of nine flights of a season."""
    rng = np.random.default_rng(3)
    *before, this = (with_biases(k, rng) for k in range(9))
    found = compared(tmp_path, monkeypatch, this | planted, *before)
    assert [one["name"] for one in found["different"]] == names
    assert (found["flights"], found["equipment"]) == (8, "wing3")
    assert found["last_utc"] == before[-1]["date_utc"]


def test_a_season_without_differences_is_quiet() -> None:
    """Oracle: the chances that are stated; 2000 flights differ by their sigmas alone."""
    rng = np.random.default_rng(4)
    named = 0
    for _ in range(400):
        this, *before = (with_biases(k, rng) for k in range(6))
        different = (*earlier._constants(this, before), *earlier._biases(this, before))
        named += sum(one["differs"] for one in different)
    assert named <= 4


def test_flights_of_others_later_and_failed_ones_do_not_count(tmp_path, monkeypatch) -> None:
    """Oracle: by hand; of five flights one is an earlier one of this equipment with a result."""
    rng = np.random.default_rng(5)
    flights = [with_biases(k, rng) for k in range(5)]
    flights[0] |= {"equipment": "wing4"}
    flights[1] |= {"status": "failed"}
    found = compared(tmp_path, monkeypatch, flights[3], *flights[:3], flights[4])
    assert found["flights"] == 1
    flights[2] |= {"equipment": "elsewhere/wing3"}
    assert compared(tmp_path, monkeypatch, flights[3], *flights[:3]) is None


@pytest.mark.slow
def test_the_page_says_what_differs_from_earlier_flights(tmp_path) -> None:
    """Oracle: one recording in three weeks, of which nothing differs; the first has no earlier."""
    flights = seasons.copies(seasons.short_flight(tmp_path), 3)
    assert seasons.batch(tmp_path, cwd=tmp_path).returncode == 0
    later = insgnss.process(flights[2])
    assert (later.report["earlier"]["flights"], later.report["earlier"]["different"]) == (2, [])
    directory = later.files[0].parent
    page = (directory / "report.html").read_text()
    assert "as in 2 earlier flights of wing3, the last of" in page
    assert (
        json.loads((directory / "report.json").read_text())["earlier"]["season"] == "../season.csv"
    )
    assert insgnss.process(flights[0]).report.get("earlier") is None
    (tmp_path / "season.csv").unlink()
    assert insgnss.process(flights[2]).report.get("earlier") is None
