"""The rules on what limits a flight: each is said of a flight made so, with its numbers, and not of
a good one.
"""

import dataclasses
import re
from typing import Any

import numpy as np
import pytest

import insgnss
from insgnss.navigation.diagnosis.variances import SHARES, SLOW_S
from insgnss.records import Check, Estimate, MeanResidual, TimeCorrelatedError
from insgnss.records.cameras.mounting import boresight_from_angles
from insgnss.records.states import OF_LEVER_ARM, SCALE_FACTOR, TIME_OFFSET, State
from insgnss.report.rules.fixes import time_correlated
from insgnss.report.rules.verdict import (
    MOST_SENTENCES,
    NOTHING_STANDS_OUT,
    USUAL_SHARE,
    _if_clocks_drift,
    _if_usual,
)
from insgnss.report.sections import limits
from insgnss.report.summary import run_summary
from insgnss.report.verdict import run_verdict

START = 205200.0
STANDING = {"name": "laser", "gnss": {"stationary": [60.0, 8.0, 400.0]}}


def run(d: Any, eo: Any = None, flight: Any = None) -> dict[str, Any]:
    return run_summary(d, eo, flight or {"name": "f"}, {}, {}, {}, ())


def said(summary: dict[str, Any], topic: str) -> dict[str, Any]:
    """The one limit of that topic."""
    (limit,) = [limit for limit in summary["limits"] if limit["topic"] == topic]
    return limit


def with_sigma(d: Any, rows: slice, column: int, sigma: float) -> np.ndarray:
    changed = d.smoothed_sigma.copy()
    changed[rows, column] = sigma
    return changed


def test_limits_are_in_order_and_the_verdict_is_their_beginning(diagnostics, eo) -> None:
    """Oracle: definition; ranks fall, and the verdict holds the first sentences with their help."""
    checks = tuple(Check(f"check {k}", "a", "b", "note", "look") for k in range(12))
    s = run(
        diagnostics(
            2.0, checks=checks, gaps=((START + 5, 0.5),), covariance_resets=np.array([START + 9])
        ),
        eo(0.31),
    )
    ranks = [limit["rank"] for limit in s["limits"]]
    assert ranks == sorted(ranks, reverse=True)
    assert len(s["verdict"]) == MOST_SENTENCES < len(s["limits"])
    for sentence, limit in zip(s["verdict"], s["limits"], strict=False):
        assert sentence == (f"{limit['text']}; {limit['help']}" if limit["help"] else limit["text"])


@pytest.mark.parametrize("seed", [1, 2])
def test_headline_says_what_slow_errors_of_usual_size_leave(seed) -> None:
    """Oracle: the filter itself with such an error among its states, of the mean share and rate
    (V.3) of what is usual of PPK; nothing is said where it is there, or where the flight file
    excludes it.
    """
    variance = sum(weight * share**2 for share, weight in SHARES.items())
    time_s = 1.0 / sum(weight / one for one, weight in SLOW_S.items())
    assert pytest.approx(np.sqrt(variance), rel=0.02) == USUAL_SHARE
    sim = insgnss.simulate("ign8", 4.0, imu_rate_hz=100.0, seed=seed)
    mounting = dataclasses.replace(sim.mounting, antenna_sigma_m=None)
    records = sim.imu, sim.gnss, sim.events

    def headline(**options: Any) -> str:
        return insgnss.estimate(
            *records, mounting=mounting, noise="navchip", gnss__correlation_time_s=time_s, **options
        ).report["headline"]

    stated = re.search("PPK does as a rule, the sigmas are (.*) mm", headline())
    assert stated is not None
    slow = headline(gnss__gm_sigma=USUAL_SHARE)
    filtered = re.search("median sigmas (.*) mm", slow)
    assert filtered is not None
    sizes = [[float(x) for x in found[1].split(" / ")] for found in (stated, filtered)]
    np.testing.assert_allclose(*sizes, rtol=0.1)
    assert "as a rule" not in slow
    assert "as a rule" not in headline(gnss__gm_sigma="off")


@pytest.mark.parametrize(
    ("time_s", "share", "stated", "said"),
    [
        (75.0, 1.1, "auto", "40.0 / 53.0 / 60.0 mm"),
        (75.0, 0.9, "auto", "63.2 / 83.8 / 94.9 mm"),
        (310.0, 0.9, "auto", ""),
        (75.0, 0.9, 0.5, ""),
    ],
)
def test_headline_says_what_slower_errors_leave(time_s, share, stated, said) -> None:
    """Oracle: by hand: of c^2 / T alone, 20 mm over 75 s are 40 mm over 300 s, and 63 mm with 2.5
    times the rate where the flight hardly shows it; nothing is said of errors that last as long
    already, or that the flight file states.
    """
    error = {"time_s": time_s, "fixes": 3000, "sigma_m": [0.0265, 0.02, 0.03]}
    error["share"] = [share] * 3
    figures = {
        "flight": {"gnss": {"gm_sigma": stated}},
        "innovations": {"median_sigma_mm": [20.0, 20.0, 30.0]},
        "time_correlated_errors": [error],
        "use": {"need_m": [0.06, 0.06, 0.06]},
    }
    claim = {"axes": ["E", "N", "U"], "position_mm": {"median": [20.0, 26.5, 30.0]}}
    text = _if_usual(figures, claim)
    assert bool(text) is bool(said)
    if said:
        assert "this holds for GNSS errors with a correlation time of 75 s; with 300 s" in text
        assert said in text
        assert ("more than is needed: compare" in text) is (share < 1.0)  # of 60 mm


@pytest.mark.parametrize(
    ("observed", "requested", "speed_mps", "said"),
    [
        (False, False, 15.0, "63.0 mm"),
        (True, False, 15.0, ""),
        (False, True, 15.0, ""),
        (False, False, 1.0, ""),
    ],
)
def test_headline_says_what_free_clocks_leave(observed, requested, speed_mps, said) -> None:
    """Oracle: by hand: 50 ppm over 84 s are 4.2 ms, 63 mm at 15 m/s; nothing is said where the
    flight tells the rate, where its file asks for it, or of 4 mm beside 15.
    """
    rate = {"name": "GNSS clock rate", "sigma": 1e-5, "moves_m": 1e-5 * 84.0 * speed_mps}
    rate |= {"observed": observed, "requested": requested}
    claim = {"position_mm": {"median": [12.0, 15.0, 15.0]}}
    text = _if_clocks_drift({"states": [rate]}, claim)
    assert bool(text) is bool(said)
    assert said in text


@pytest.mark.parametrize(("share", "stands_out"), [(0.3, False), (0.5, True)])
def test_a_slow_error_that_no_flight_shows_is_a_remark(share, stands_out) -> None:
    """Oracle: definition: of rank one or more is what is no remark."""
    error = {"time_s": 80.0, "fixes": 3000, "share": [share] * 3, "sigma_m": [0.01] * 3}
    figures = {"neighbours": None, "counts": {"fixes": 3000}, "time_correlated_errors": [error]}
    (limit,) = time_correlated(figures)
    assert (limit.rank >= 1.0) is stands_out


def test_headline_counts_images_that_are_far_worse_than_the_rest(diagnostics, eo) -> None:
    """Oracle: by hand; four of thirty images with nine times the sigma, within the need of 30 mm,
    none in a good run; with eleven times the verdict counts them.
    """
    images = eo()
    headlines = []
    for times in (9.0, 11.0):
        cov = images.cov.copy()
        cov[7:11] *= times**2
        headlines.append(run(diagnostics(), dataclasses.replace(images, cov=cov))["headline"])
    far = "; 4 images with more than 3 times the median, up to 18.0 / 27.0 / 36.0 mm; "
    assert far in headlines[0]
    assert headlines[1].startswith(
        "Use it except 4 images (8008.tif ... 8011.tif): the other 26 images: "
    )
    assert "times the median" not in headlines[1]
    assert "times the median" not in run(diagnostics(), images)["headline"]


def test_remarks_alone_leave_nothing_that_stands_out(diagnostics, eo) -> None:
    """Oracle: definition; a note of a check is said after the sentence that nothing stands out."""
    s = run(diagnostics(checks=(Check("rate", "a", "b", "note"),)), eo())
    assert s["verdict"] == [NOTHING_STANDS_OUT, "rate: a (expected: b)"]


def test_what_was_adopted_against_the_flight_file_stands_out(diagnostics, eo) -> None:
    """A solution with another lever arm than that of the flight file is no calm one, although its
    innovations are those of a good flight.
    """
    s = run(diagnostics(checks=(Check("antenna lever arm", "a", "b", "note"),)), eo())
    assert s["verdict"][0] == "antenna lever arm: a (expected: b)"
    assert said(s, "checks")["rank"] > 1.0
    by_chance = Check("antenna lever arm", "a", "b", "note", beyond_chance=False)
    assert said(run(diagnostics(checks=(by_chance,)), eo()), "checks")["rank"] < 1.0


@pytest.mark.parametrize(
    ("rows", "line", "why"),
    [(slice(0, 220), 1, "no turn came before it"), (slice(880, 1200), 4, "no turn followed it")],
)
def test_weak_line_is_named_with_its_reason(block, rows: slice, line: int, why: str) -> None:
    """Oracle: exact motion; heading sigma 0.12 deg on the first or last of four lines, 0.02 deg on
    the others.
    """
    d = block()
    limit = said(run(block(smoothed_sigma=with_sigma(d, rows, 8, np.radians(0.12)))), "heading")
    assert limit["text"].startswith(f"heading is known to 0.12 deg on line {line} (TOW ")
    assert limit["text"].endswith(f"to 0.02 deg in the median of the lines: {why}")
    assert limit["rank"] == pytest.approx(0.12 / 0.02 / 1.5)
    assert f"line {line}" in limit["help"]


def test_weak_line_in_an_outage_is_told_so(block) -> None:
    """Oracle: by hand; the fixes of 30 to 50 s are missing, where line 2 is."""
    d = block()
    used = (d.time < START + 30) | (d.time > START + 50)
    limit = said(
        run(block(used=used, smoothed_sigma=with_sigma(d, slice(300, 500), 8, np.radians(0.12)))),
        "heading",
    )
    assert "on line 2" in limit["text"]
    assert "no GNSS position was used for 20." in limit["text"]
    assert limit["help"] == "repeat the line"


def test_weakest_line_of_a_good_flight_is_not_said(block) -> None:
    """Oracle: by hand; 0.025 deg against 0.02 deg is less than 1.5 times the median."""
    s = run(block(smoothed_sigma=with_sigma(block(), slice(300, 500), 8, np.radians(0.025))))
    assert s["verdict"] == [NOTHING_STANDS_OUT]


@pytest.mark.parametrize(("axis", "name"), [(5, "heading"), (3, "tilt")])
def test_the_worst_image_is_named_with_its_angle(diagnostics, eo, axis, name) -> None:
    """Oracle: by hand; 0.5 deg about up or east at the eighth image, 0.02 deg at the others."""
    images = eo()
    cov = images.cov.copy()
    cov[7, axis, axis] = np.radians(0.5) ** 2
    text = said(run(diagnostics(), dataclasses.replace(images, cov=cov)), "image")["text"]
    assert text.startswith(f"the {name} of image 8008.tif at 09:00:")
    assert text.endswith("is known to 0.5 deg, 25.0 times the median")


def test_steps_of_rejected_fixes_are_not_said_twice(diagnostics, eo) -> None:
    """Oracle: definition; the check of their speed is left out where the gate rejected fixes."""
    check = Check("GNSS speed", "24 steps over 100 m/s", "none", "note")
    used = np.arange(1200) % 20 != 0
    for rows, times in ((used, 0), (used | True, 1)):
        s = run(diagnostics(used=rows, checks=(check,)), eo())
        assert sum("24 steps" in limit["text"] for limit in s["limits"]) == times
        assert any("rejected by the gate" in limit["text"] for limit in s["limits"]) != times


def test_outage_names_its_images_and_sigmas(diagnostics, eo) -> None:
    """Oracle: by hand; no fix from 50 to 95 s, images at events within, sigmas of 0.6 m there."""
    d = diagnostics()
    used = (d.time <= START + 50) | (d.time >= START + 95)
    sigma = with_sigma(d, slice(520, 930), 0, 0.6)
    s = run(diagnostics(used=used, smoothed_sigma=sigma), eo())
    limit = said(s, "outage")
    inside = [
        name for name, t in zip(eo().images, eo().time, strict=True) if START + 50 < t < START + 95
    ]
    assert (
        "no GNSS position was used for 45.0 s from 09:00:32 UTC (TOW 205250.0 s) on (449 were"
        f" rejected), images {inside[0]} to {inside[-1]} ({len(inside)})" in limit["text"]
    )
    assert "known to 600 mm horizontally and " in limit["text"]
    assert limit["rank"] == s["limits"][0]["rank"] or limit["rank"] > 20
    (outage,) = s["outages"]
    assert (outage["images"], outage["rejected"]) == (len(inside), 449)


def test_time_between_parts_is_no_outage(diagnostics) -> None:
    """Oracle: by hand; between two parts, solved by themselves, there is neither fix nor
    solution.
    """
    d = diagnostics()
    inside = (d.time > START + 40) & (d.time < START + 70)
    fields = {
        name: getattr(d, name)[~inside]
        for name in ("fix_time", "innovation", "innovation_sigma", "nis", "used")
    }
    apart = run(diagnostics(**fields, segments=((START, START + 40), (START + 70, START + 119.9))))
    assert apart["outages"] == []
    assert (
        "2 segments that are solved one by one, and for 30 s between them"
        in said(apart, "segments")["text"]
    )
    assert len(run(diagnostics(**fields))["outages"]) == 1


def test_time_correlated_errors_say_what_neighbours_share(diagnostics, eo) -> None:
    """Oracle: closed form; neighbours of variance 9, 4, 16 mm^2 that share three quarters of it
    differ by half that.
    """
    e = eo()
    e = dataclasses.replace(e, cross=0.75 * e.cov[:-1])
    s = run(
        diagnostics(
            time_correlated=(
                TimeCorrelatedError(
                    15.0, 1200, (0.018, 0.018, 0.027), (0.9, 0.9, 0.9), (0.4, 0.4, 0.4)
                ),
            )
        ),
        e,
    )
    assert s["neighbours"]["position_mm"] == pytest.approx(np.sqrt(0.5) * np.array([2, 3, 4]))
    text = said(s, "time-correlated errors")["text"]
    assert (
        "the receiver's errors are taken as time-correlated over 15 s, 0.90 of its sigmas"
        " (18.0 / 18.0 / 27.0 mm, N / E / D)" in text
    )
    assert (
        "known to 1.4 / 2.1 / 2.8 mm relative to each other, to 2.0 / 3.0 / 4.0 mm absolutely"
        in text
    )


def test_code_positions_are_said_to_be_absolute_and_relative(diagnostics) -> None:
    """Oracle: closed form; a Gauss-Markov error of 2.5 m that lasts 600 s changes by 2.5 sqrt(2 (1
    - exp(-0.1))) m in a minute.
    """
    sigma = diagnostics().smoothed_sigma.copy()
    sigma[:, :3] = 2.4, 2.4, 4.5
    s = run(
        diagnostics(
            smoothed_sigma=sigma,
            time_correlated=(
                TimeCorrelatedError(600.0, 1200, (2.5, 2.5, 5.0), (1, 1, 1), (1, 1, 1)),
            ),
        )
    )
    text = said(s, "absolute position")["text"]
    change = np.sqrt(2 * (1 - np.exp(-0.1)))
    assert "known only to 3.39 m horizontally and 4.50 m in height" in text
    assert (
        f"from one minute to the next positions agree to {2.5 * np.sqrt(2) * change:.2f} m and"
        f" {5 * change:.2f} m" in text
    )
    assert s["headline"].startswith("Use it: trajectory: median sigmas 2.40 / 2.40 / 4.50 m")


def test_constants_that_are_not_observed_limit_the_flight(diagnostics) -> None:
    """Oracle: by hand; a lever arm of sigma 0.28 m (0.30 before) moves 280 mm of 4 mm; a time
    offset of 12.5 ms is a remark.
    """
    states = (
        Estimate(OF_LEVER_ARM[0], 0.01, 0.28, 0.3, 0.28),
        Estimate(TIME_OFFSET, 0.0125, 0.0009, 0.1, 0.014),
        Estimate(State(SCALE_FACTOR, "x", "", "gyro"), 1e-4, 9e-4, 1e-3, None),
    )
    s = run(diagnostics(states=states))
    lever, *others = [limit for limit in s["limits"] if limit["topic"] == "constants"]
    assert (
        "does not determine the antenna lever arm forward: sigma 0.28 m after the flight,"
        " 0.3 m before it, which moves positions by 280 mm" in lever["text"]
    )
    assert lever["rank"] == pytest.approx(70.0)
    assert any("GNSS time offset +12.5 +- 0.9 ms" in limit["text"] for limit in others)
    assert any(
        "the flight cannot determine gyro x scale factor" in limit["text"] for limit in others
    )
    assert max(limit["rank"] for limit in others) < 1.0
    assert not any("imu_m" in str(limit) for limit in others)


def test_an_estimated_lever_arm_says_what_the_flight_sees(diagnostics) -> None:
    """Oracle: the geometry; a flight sees the antenna from the IMU, and no camera."""
    states = (Estimate(OF_LEVER_ARM[0], -0.211, 0.007, 0.3, 0.007),)
    (found,) = (
        one for one in run(diagnostics(states=states))["limits"] if "corrected" in one["text"]
    )
    assert "antenna lever arm forward -0.211 +- 0.007 m" in found["text"]
    assert "if imu_m is wrong instead, the images are off" in str(found)
    adopted = tuple(dataclasses.replace(state, requested=False) for state in states)
    assert not run(diagnostics(states=adopted))["limits"]  # the check that adopted them has them


@pytest.mark.parametrize(
    ("value", "stated", "asked", "doubtful"),
    [
        (-0.198, 0.005, 0.3, True),
        (-0.198, 0.0, 0.3, True),
        (-0.198, 0.1, 0.3, False),  # within 3 of what is stated
        (-0.198, 0.005, 0.31, False),  # the same, as filter.lever_arm_sigma_m says it
        (-0.018, 0.001, 0.3, False),  # a right one may come out so
    ],
)
def test_a_lever_arm_far_from_its_statement_leaves_the_images_in_doubt(
    diagnostics, eo, value, stated, asked, doubtful
) -> None:
    """Oracle: the geometry; the axes of the camera are those of the body turned by 180 deg about
    down, and antenna minus IMU is what the flight sees.
    """
    states = (Estimate(OF_LEVER_ARM[1], value, 0.0047, asked, 0.005),)
    turn, none = [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]], np.eye(3).tolist()
    mounting = {"antenna_m": [0.462, -0.001, -0.065], "imu_m": [0.113, 0.22, 0.0]}
    mounting |= {"antenna_sigma_m": stated, "camera_from_body": turn, "boresight": none}
    options = {"lever_arm": True, "lever_arm_sigma_m": asked}
    flight = {"name": "f", "mounting": mounting, "filter": options}
    s = run(diagnostics(states=states), eo(), flight)
    assert any("cannot determine whether imu_m" in x for x in s["use"]["reasons"]) == doubtful
    assert run_verdict(s).word == ("bad" if doubtful else "good")
    if doubtful:
        limit = said(s, "lever arm")
        assert limit["rank"] > 2.0
        assert "cannot determine whether imu_m or antenna_m is wrong" in limit["text"]
        assert "mounting.imu_m = [0.113, 0.022, 0.000]" in limit["help"]
        assert "mounting.antenna_m = [0.462, 0.197, -0.065]" in limit["help"]
    assert run(diagnostics(states=states), None, flight)["use"]["verdict"] == "use"


def test_standing_says_nothing_of_fixes_that_were_made_up(diagnostics) -> None:
    """Oracle: closed form; at 60 deg latitude half of the Earth's rotation is level, and 0.02 deg
    of heading is 0.0026 deg/h of it.
    """
    check = Check("turn rate, gyro against GNSS course", "no turns", "some", "note")
    d = diagnostics(0.1, stationary=np.array([[START, START + 100]]), checks=(check,))
    s = run(d, flight=STANDING)
    assert [limit["topic"] for limit in s["limits"]] == ["standing"]
    assert "a level rate known to 0.0026 of the Earth's 7.5 deg/h" in s["verdict"][0]
    assert s["headline"].endswith("the sensor stands at a given place, no fixes support them")
    assert "scatter 0.1" in " ".join(run(d)["verdict"])


def test_sigmas_of_another_unit_are_asked_for_first(diagnostics) -> None:
    """Oracle: by hand; positions known to 25 m would stand first, but for innovations of 0.04."""
    limits = {}
    for scale in (0.04, 1.0):
        sigma = diagnostics().smoothed_sigma.copy()
        sigma[:, :3] = 20.0
        limits[scale] = run(diagnostics(scale, smoothed_sigma=sigma))["limits"]
    assert limits[1.0][0]["topic"] == "absolute position"
    assert limits[0.04][0]["text"].startswith("the GNSS positions scatter 0.04 times as much")
    assert limits[0.04][0]["text"].endswith("; are the sigmas in mm?")


def test_weak_attitude_heights_and_gyros_are_said(diagnostics) -> None:
    """Oracle: by hand; heading 0.6, tilt 0.2 deg, heights 9 mm against 3 mm, gyros to 90 deg/h."""
    sigma = diagnostics().smoothed_sigma.copy()
    sigma[:, 2] = 0.009
    sigma[:, 6:] = np.radians([0.2, 0.2, 0.6])
    s = run(
        diagnostics(smoothed_sigma=sigma, bias_sigma=np.radians(np.full((1200, 6), 90.0)) / 3600.0)
    )
    assert (
        "heading is known to 0.6 deg in the median of the images, 3.0 times the sigma of tilt"
        in said(s, "heading")["text"]
    )
    assert "a level accelerometer's bias of 3.5 mg" in said(s, "tilt")["text"]
    assert "9.0 mm, 3.0 times as uncertain as east and north (3.0 mm)" in said(s, "heights")["text"]
    assert (
        "90 deg/h at the end: where GNSS is missing, the images turn by 1.5"
        in said(s, "gyro bias")["text"]
    )


def away(sigmas: float, pieces: int = 15) -> tuple[MeanResidual, ...]:
    """Residuals of a quarter of their sigma, of the fifth minute `sigmas` times that, downward."""
    return tuple(
        MeanResidual(
            START + 60.0 * k,
            START + 60.0 * k + 59.0,
            600,
            (0.0025, -0.0025, 0.02 * sigmas if k == 4 else 0.005),
            (0.01, 0.01, 0.02),
        )
        for k in range(pieces)
    )


def test_a_solution_that_leaves_its_fixes_stands_first(diagnostics, eo) -> None:
    """Oracle: by hand; 0.16 m of 0.02 m in one of 15 minutes, whose bound is 4.74 sigma (normal
    quantile of 1e-4 / 90); everything else is that of a good flight.
    """
    s = run(diagnostics(residuals=away(8.0)), eo())
    begins = (
        "the trajectory, and with it the images, is 160 mm down off the GNSS positions in the mean"
        " of 09:03:42 to 09:04:41 UTC (TOW 205440.0 to 205499.0 s); this is 8.0 times what the"
        " sigmas allow (limit 4.7, exceeded by 1 of 15 pieces)"
    )
    assert s["verdict"][0].startswith(begins)
    r = s["residuals"]
    assert (r["beyond"], r["worst"]["sigma_mm"], len(r["pieces"])) == (1, pytest.approx(20.0), 15)
    assert r["limit"] == pytest.approx(4.74, abs=0.02)
    assert r["pieces"][4]["mean_mm"] == pytest.approx([2.5, -2.5, 160.0])


def test_residuals_within_their_bound_say_nothing(diagnostics, eo) -> None:
    """Oracle: by hand; 4.5 sigma in one of 15 minutes is less than chance allows; of one minute
    alone it is more.
    """
    s = run(diagnostics(residuals=away(4.5)), eo())
    assert s["verdict"] == [NOTHING_STANDS_OUT]
    alone = run(diagnostics(residuals=away(4.5)[4:5]), eo())
    assert alone["verdict"][0].startswith(
        "the trajectory, and with it the images, is 90.0 mm down off"
    )


def test_sigmas_that_are_too_wide_are_said(diagnostics, eo) -> None:
    """Oracle: by construction; separations of a fifth of their sigmas, all the rest that of a good
    flight.
    """
    d = diagnostics()
    s = run(diagnostics(separation=0.2 * d.separation), eo())
    assert s["verdict"][0] != NOTHING_STANDS_OUT
    assert "far better than their sigmas say" in s["verdict"][0]
    assert s["separation"]["of_all_axes"]["position"] == pytest.approx(0.2, rel=0.2)
    assert said(s, "separation")["rank"] > 2.0


@pytest.mark.parametrize("sigmas", [5.0, 9.0])
def test_a_disagreement_of_a_few_seconds_is_said(diagnostics, eo, sigmas) -> None:
    """Oracle: the one epoch that is changed; fixes that drift by 2 cm/s for half a minute."""
    d = diagnostics()
    apart = d.separation.copy()
    apart[7, 5] = sigmas * d.separation_sigma[7, 5]
    s = run(diagnostics(separation=apart), eo())
    if sigmas < 6.0:
        assert s["verdict"] == [NOTHING_STANDS_OUT]
        return
    text = said(s, "separation")["text"]
    assert "9.0 sigmas in velocity D at 08:59:49 UTC " in text
    assert f"(TOW {d.separation_time[7]:.1f} s)" in text


def test_a_small_constant_separation_says_nothing_of_sigmas(diagnostics, eo) -> None:
    """Oracle: (T.3); what stays the same over the flight is one value, and may be small."""
    d = diagnostics()
    s = run(diagnostics(separation=0.2 * d.separation_sigma), eo())
    assert s["verdict"] == [NOTHING_STANDS_OUT]


def hidden(summary: dict[str, Any]) -> dict[str, str]:
    """What no flight can show: effect by name."""
    return {error["name"]: error["effect"] for error in summary["hidden_errors"]}


def test_a_large_boresight_is_said_and_an_ordinary_one_is_hidden(diagnostics, eo) -> None:
    """Oracle: by hand; heading sigma 0.02 deg, B of (M.5) with a yaw; 0.1 deg in 100 m is the arc
    of 0.1 pi / 1.8 m.
    """
    arc = "0.1 deg or 175 mm on the ground 100 m away"
    for yaw, sigmas in ((0.4, None), (-3.2, 160.0)):
        B = boresight_from_angles("rpy", [0.0, 0.0, yaw])
        s = run(diagnostics(), dataclasses.replace(eo(), boresight=B))
        assert (
            f"{arc}; the stated bore-sight turns the heading by {yaw:+.2f} deg"
            in (hidden(s)["bore-sight"])
        )
        assert (s["verdict"] == [NOTHING_STANDS_OUT]) == (sigmas is None)
        if sigmas is not None:
            assert f"by {yaw:+.2f} deg = {sigmas:.1f} sigma" in said(s, "bore-sight")["text"]
        assert s["use"]["verdict"] == "use"


def test_what_no_flight_shows_is_listed_once(block, diagnostics, eo) -> None:
    """Oracle: definition; the check's numbers stand in the list and nowhere else, 10 arcsec in
    100 m are 4.8 mm, and neither a sensor at a given place nor a flight without camera has images.
    """
    check = Check("unseen constants", "a lever arm below 27 mm", "seen", "note", "measure it")
    s = run(diagnostics(checks=(check,)), eo())
    effects = hidden(s)
    allowed = "; the sigmas allow for an arm off by 5 mm, in height by 20 mm"
    assert [name for name, text in effects.items() if text == check.found + allowed] == [
        "antenna phase centre and GNSS time stamps"
    ]
    assert s["verdict"] == [NOTHING_STANDS_OUT]
    assert not s["limits"]
    assert "0.0028 deg or 4.8 mm on the ground" in effects["deflection of the vertical"]
    # half of the tilt's 0.004 deg times g, over (2 pi / 120 s)^2
    assert effects["slow errors of the GNSS positions"].endswith(
        "does not notice a swing of about 125 mm"
    )
    of_images = {"bore-sight", "events shifted by one"}
    assert effects.keys() >= of_images
    assert not hidden(run(block())).keys() & of_images
    d = diagnostics(0.1, stationary=np.array([[START, START + 100]]))
    assert run(d, flight=STANDING)["hidden_errors"] == []


def test_one_fault_is_said_once_on_the_page(diagnostics, eo) -> None:
    """Oracle: definition; what the verdict gives as its reason is no remark below it."""
    need = {"output": {"need_m": [0.0025, 0.0035, 0.0045]}}
    s = run(diagnostics(2.0, residuals=away(8.0)), eo(), need)
    assert {"innovations", "residuals"} <= {limit["topic"] for limit in s["limits"]}
    assert "scatter 2.0 times" in " ".join(s["use"]["reasons"])
    remarks = limits(s)
    listed = " ".join([*remarks.parts, *remarks.more])
    assert "scatter" not in listed


@pytest.mark.parametrize(
    ("flight", "told"),
    [
        ({}, True),
        ({"accept": ["mounting"]}, True),
        ({"accept": ["bore-sight"]}, False),
        ({"mounting_files": [{"keys": ["boresight"], "made": {"boresight_cov": [[1]]}}]}, False),
        ({"mounting_files": [{"keys": ["boresight"], "made": {"boresight_cov": None}}]}, True),
        ({"mounting_files": [{"keys": ["antenna_m"], "made": {"boresight_cov": [[1]]}}]}, True),
    ],
)
def test_a_boresight_that_is_known_is_not_said(diagnostics, eo, flight, told) -> None:
    """Oracle: definition; one of a calibration, or one that the flight file accepts."""
    B = boresight_from_angles("rpy", [0.0, 0.0, 3.0])
    s = run(diagnostics(), dataclasses.replace(eo(), boresight=B), flight)
    assert any(limit["topic"] == "bore-sight" for limit in s["limits"]) == told


def test_a_boresight_within_the_sigma_of_heading_is_not_said(diagnostics, eo) -> None:
    """Oracle: by hand; 0.015 deg of heading against 0.02; 0.7 deg of roll turn no heading."""
    for angles in ([0.0, 0.0, 0.015], [0.7, 0.0, 0.0]):
        B = boresight_from_angles("rpy", angles)
        s = run(diagnostics(), dataclasses.replace(eo(), boresight=B))
        assert s["verdict"] == [NOTHING_STANDS_OUT]


def test_withheld_fixes_are_not_said_to_be_rejected_by_the_gate(diagnostics, eo) -> None:
    """Oracle: definition; the check says why they are left out, and it alone."""
    d = diagnostics()
    used = np.ones(d.time.size, dtype=bool)
    used[300:400] = False
    check = Check("incorrect fixes", "they are left out", "one level", "note")
    s = run(diagnostics(used=used, withheld=~used, checks=(check,)), eo())
    assert not any("rejected by the gate" in limit["text"] for limit in s["limits"])
    assert any("they are left out" in limit["text"] for limit in s["limits"])
    more = used.copy()
    more[500:550] = False
    s = run(diagnostics(used=more, withheld=~used, checks=(check,)), eo())
    assert "50 of 1200 fixes (4.2 %) were rejected by the gate" in said(s, "rejected")["text"]


def test_sigmas_that_were_enlarged_without_need_stand_out(diagnostics, eo) -> None:
    """Oracle: definition; this note alone is more than a remark."""
    check = Check(
        "sigmas of the fixes",
        "the sigmas of the file explain the innovations as white",
        "no larger",
        "note",
        "off",
    )
    s = run(diagnostics(checks=(check,)), eo())
    assert s["verdict"][0].startswith(
        "sigmas of the fixes: the sigmas of the file explain the innovations as white"
    )


@pytest.mark.parametrize(
    ("changes", "said_so"),
    [
        ({}, True),
        ({"lever_arm": False}, False),
        ({"antenna_m": [0.0, 0.0, 0.0]}, False),
        ({"sigma": 0.001}, False),
    ],
)
def test_a_measured_lever_arm_that_is_estimated_all_the_same(
    diagnostics, eo, changes, said_so
) -> None:
    """Oracle: by hand: 18 mm of an arm that the mounting states, beside images of 4 mm; nothing
    where it is not estimated, not stated, or known to a millimetre.
    """
    states = tuple(
        Estimate(state, 0.0, changes.get("sigma", 0.018), 1.0, 0.018) for state in OF_LEVER_ARM
    )
    mounting = {"antenna_m": changes.get("antenna_m", [0.3, 0.0, 0.4]), "imu_m": [0.0, 0.0, 0.0]}
    mounting |= {"antenna_sigma_m": None, "boresight": np.eye(3).tolist()}
    options = {"lever_arm": changes.get("lever_arm", True), "lever_arm_sigma_m": 1.0}
    flight = {
        "name": "f",
        "mounting": mounting | {"camera_from_body": np.eye(3).tolist()},
        "filter": options,
    }
    s = run(diagnostics(states=states), eo(), flight)
    texts = [limit["text"] for limit in s["limits"] if limit["topic"] == "estimated lever arm"]
    assert bool(texts) is said_so
    if said_so:
        assert "lever arm of 0.50 m" in texts[0]
        assert "18.0 mm remain, a large part of the 4.0 mm of the images" in texts[0]
