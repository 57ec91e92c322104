"""Constants of an equipment over a season: false alarms, power, and what is left unsaid."""

import numpy as np
import pytest
from seasons import SIGMA_M, row

from insgnss.batch.season.row import known_from_refusal
from insgnss.batch.season.trends import FEWEST_FLIGHTS, TREND_QUANTITIES, fit, judge_trend, trends

FORWARD = TREND_QUANTITIES[0]
MM = 1e3 * SIGMA_M


def season(count: int, rng: np.random.Generator, drift_mm_per_day: float = 0.0) -> list:
    rows = [row(k, rng) for k in range(count)]
    for k, one in enumerate(rows):
        one["lever_arm_forward_m"] += 1e-3 * drift_mm_per_day * 4 * k
    return rows


def test_the_line_is_that_of_weighted_least_squares() -> None:
    """Oracle: numpy's polyfit with weights and its scaled covariance."""
    rng = np.random.default_rng(3)
    days, sigma = np.sort(rng.uniform(0, 100, 12)), rng.uniform(1, 5, 12)
    value = 3.0 + 0.2 * days + 2.0 * sigma * rng.normal(size=12)
    (slope, level), cov = np.polyfit(days, value, 1, w=1 / sigma, cov="unscaled")
    got = fit(days, value, sigma)
    assert got[0] == pytest.approx(slope)
    assert got[2] == pytest.approx(level)
    x = np.sum(((value - level - slope * days) / sigma) ** 2) / 10
    assert got[3] == pytest.approx(x)
    assert x > 1.0
    assert got[1] == pytest.approx(np.sqrt(cov[0, 0] * x))


@pytest.mark.parametrize("count", [FEWEST_FLIGHTS, 40])
def test_constants_that_stay_are_left_alone(count: int) -> None:
    """Oracle: Monte Carlo of constant lever arms; two-sided 4 sigma are 6e-5 of all trends, a
    chi-square beyond 1e-4, and the physical limit takes most of these. 2000 trends: one at most.
    """
    rng = np.random.default_rng(4)
    days = 4.0 * np.arange(count)
    sigma, names = np.full(count, MM), [""] * count
    found = [
        judge_trend("w", FORWARD, days, MM * rng.normal(size=count), sigma, names).finding
        for _ in range(2000)
    ]
    assert set(found) <= {"steady", "drift", "scatter"}
    assert sum(finding != "steady" for finding in found) <= 1


def test_errors_that_flights_do_not_claim_are_no_drift() -> None:
    """Oracle: Monte Carlo; flights that claim a third of their errors scatter, and drift no more
    often than 4 standard deviations of a slope of unknown variance allow: Student's t of 18.
    """
    rng = np.random.default_rng(5)
    days, sigma = 4.0 * np.arange(20), np.full(20, MM)
    found = [
        judge_trend("w", FORWARD, days, 3 * MM * rng.normal(size=20), sigma, [""] * 20).finding
        for _ in range(500)
    ]
    assert found.count("drift") <= 3
    assert found.count("scatter") > 480


def test_a_drift_is_named_with_its_equipment_and_its_rate() -> None:
    """Oracle: 0.15 mm a day over 156 days, 23 mm where one flight knows 4 mm: 17 sigma."""
    rows = season(40, np.random.default_rng(6), 0.15)
    rows += [row(k, np.random.default_rng(k), equipment="wing4") for k in range(40)]
    odd = [trend for trend in trends(rows) if trend.odd]
    assert [(t.equipment, str(t.quantity.state), t.finding) for t in odd] == [
        ("wing3", "antenna lever arm forward", "drift")
    ]
    trend = odd[0]
    assert abs(trend.slope - 0.15) < 4 * trend.slope_sigma
    days = 4.0 * np.arange(40)
    expected = MM / np.sqrt(np.sum((days - days.mean()) ** 2))
    assert trend.slope_sigma == pytest.approx(expected, rel=0.35)
    assert "the antenna lever arm forward of wing3 drifts by +4." in trend.sentence()


def test_the_power_is_what_sigmas_allow() -> None:
    """Oracle: a slope of 6 of its standard deviations is beyond 4 in 97.7 % of seasons."""
    rng = np.random.default_rng(7)
    days, sigma = 4.0 * np.arange(20), np.full(20, MM)
    slope = 6.0 * MM / np.sqrt(np.sum((days - days.mean()) ** 2))
    found = [
        judge_trend("w", FORWARD, days, slope * days + MM * rng.normal(size=20), sigma, [""] * 20)
        for _ in range(500)
    ]
    assert np.mean([trend.finding == "drift" for trend in found]) > 0.95


def test_a_drift_that_does_not_matter_is_none() -> None:
    """Oracle: 2 mm over the season at sigmas of 0.1 mm, below the 5 mm that matter."""
    days, sigma = 4.0 * np.arange(20), np.full(20, 0.1)
    assert (
        judge_trend("w", FORWARD, days, 2.0 * days / days[-1], sigma, [""] * 20).finding == "steady"
    )


def test_too_few_flights_or_one_time_say_nothing() -> None:
    """Oracle: seven flights that drift wildly, eight on one day."""
    few = [row(k, lever_arm_forward_m=0.1 * k) for k in range(FEWEST_FLIGHTS - 1)]
    assert {trend.finding for trend in trends(few)} == {"too few"}
    assert "7 flights, and a trend needs 8" in trends(few)[0].sentence()
    date = row(0)["date_utc"]
    same = [row(k, lever_arm_forward_m=0.1 * k, date_utc=date) for k in range(FEWEST_FLIGHTS)]
    assert {trend.finding for trend in trends(same)} == {"one time"}
    assert trends([row(0, date_utc="")]) == []


def test_one_calibration_counts_once() -> None:
    """Oracle: a bore-sight of three calibrations under thirty flights is three measurements."""
    rows = [row(k, boresight_x_deg=0.1 * (k // 10), boresight_x_sigma_deg=0.001) for k in range(30)]
    found = next(t for t in trends(rows) if str(t.quantity.state) == "bore-sight x")
    assert (found.days.size, found.finding) == (3, "too few")


def test_constants_are_told_by_the_refusal_that_is_theirs_alone() -> None:
    """Oracle: a lever arm that contradicts the flight file is known; beside another contradiction,
    such as axes, it may be a consequence.
    """
    lever = {"name": "antenna lever arm down", "assumed": -0.07, "correction": -0.03}
    found = {
        "contradictions": ["antenna lever arm"],
        "span": {"gps_week": 2008, "start_tow_s": 86418.0},
        "constants": [lever | {"sigma": 0.006}],
    }
    row = known_from_refusal(found)
    assert row["lever_arm_down_m"] == pytest.approx(-0.1)
    assert row["lever_arm_down_sigma_m"] == 0.006
    assert row["date_utc"] == "2018-07-02T00:00:00Z"
    assert known_from_refusal(found | {"contradictions": ["antenna lever arm", "axes"]}) == {}
    assert (
        known_from_refusal({"contradictions": ["antenna lever arm"]})
        == known_from_refusal({})
        == {}
    )
