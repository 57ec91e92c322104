"""Figures of merit of a solution and of observations, against what was planted."""

from dataclasses import replace

import numpy as np
import pytest

from insgnss.base.errors import DataError, InputError
from insgnss.gnss.phase.signal_quality import LIGHT, signal_numbers, signals_of
from insgnss.gnss.quality.solution_quality import (
    coverage_numbers,
    longest_without,
    solution_numbers,
    solution_of,
    solution_series,
    verdict,
)
from insgnss.gnss.rinex.header import RinexHeader
from insgnss.gnss.rinex.observation_record import Observations
from insgnss.gnss.satellites.visible_satellites import Sky, position_dilution
from insgnss.io.formats.gnss.rtklib_pos import read_pos_rows
from insgnss.navigation.prepare.fix_covariance.classes import (
    DEGRADED,
    FLOAT,
    calibrate,
    forward_backward,
)
from insgnss.records import Check

F1, F2 = 1575.42e6, 1227.60e6
SIGNALS = ("C1C", "L1C", "S1C", "C2W", "L2W", "S2W")
SATELLITES = ("G05", "G12", "G17", "G23")


def observed(epochs=600, interval=0.1, code_m=0.3, seed=3, drop=(), slips=(), flagged=()):
    """Observations of four satellites: code noise `code_m`, phase noise 1 mm.

    drop : epochs left out.
    slips : (epoch, satellite, cycles on L1).
    flagged : (epoch, satellite) of the receiver's loss of lock.
    """
    rng = np.random.default_rng(seed)
    k, sat = np.meshgrid(np.arange(epochs), np.arange(len(SATELLITES)), indexing="ij")
    keep = ~np.isin(k[:, 0], drop)
    cycles = np.zeros(k.shape)
    for epoch, name, size in slips:
        cycles[epoch:, SATELLITES.index(name)] += size
    rho = 2.2e7 + 1e5 * sat + 80.0 * k * interval + rng.normal(size=k.shape)
    values = np.full((*k.shape, len(SIGNALS)), np.nan)
    for column, hertz in ((0, F1), (3, F2)):
        values[..., column] = rho + code_m * rng.normal(size=k.shape)
        values[..., column + 1] = (rho + 0.001 * rng.normal(size=k.shape)) * hertz / LIGHT
        values[..., column + 2] = (45.0 if column == 0 else 28.0) + rng.normal(size=k.shape)
    values[..., 1] += cycles
    lock = np.zeros(values.shape, dtype=np.int8)
    for epoch, name in flagged:
        lock[epoch, SATELLITES.index(name), 1] = 1
    header = RinexHeader(
        "rover.obs",
        3.04,
        "G",
        "GPS",
        "rover",
        "",
        "",
        None,
        np.zeros(3),
        interval,
        18,
        {"G": SIGNALS},
    )
    n = int(keep.sum())
    return Observations(
        header=header,
        gps_week=2000,
        time=1000.0 + interval * np.flatnonzero(keep),
        flag=np.zeros(n, dtype=np.int8),
        clock_offset_s=np.full(n, np.nan),
        epoch=np.repeat(np.arange(n), len(SATELLITES)),
        satellite=np.tile(np.array(SATELLITES), n),
        signals=SIGNALS,
        values=values[keep].reshape(-1, len(SIGNALS)),
        loss_of_lock=lock[keep].reshape(-1, len(SIGNALS)),
        strength=np.zeros((n * len(SATELLITES), len(SIGNALS)), dtype=np.int8),
        events=np.zeros(0),
    )


def test_planted_slips_are_found_with_their_satellite_and_nothing_else():
    """Oracle: two slips of one cycle and of 1000, of which the receiver flags the second; a flag
    without a step is one too.
    """
    o = observed(
        slips=[(100, "G12", 1.0), (300, "G23", 1000.0)], flagged=[(300, "G23"), (450, "G05")]
    )
    found = signals_of(o)
    assert found.slip_satellite.tolist() == ["G12", "G23", "G05"]
    assert np.allclose(found.slip_time, [1010.0, 1030.0, 1045.0], rtol=0, atol=1e-9)
    assert found.flagged.tolist() == [False, True, True]
    assert found.hours == pytest.approx(4 * 60.0 / 3600.0)


def test_the_first_epoch_after_a_gap_is_no_slip():
    """Oracle: 20 epochs left out, with a step of all ambiguities behind them."""
    o = observed(drop=range(200, 220), slips=[(220, name, 5.0) for name in SATELLITES])
    found = signals_of(o)
    assert found.slip_time.size == 0
    assert np.allclose(found.gaps, [[1019.9, 1022.0]])
    assert signal_numbers(found)["longest_gap_s"] == pytest.approx(2.1)


def test_multipath_is_the_planted_code_error():
    """Oracle: white code noise of 0.3 m and 0.6 m on both bands, phases of 1 mm."""
    for code in (0.3, 0.6):
        found = signals_of(
            observed(epochs=2000, code_m=code, slips=[(700, "G05", 4.0)])
        ).multipath_m
        assert set(found) == {"G C1C", "G C2W"}
        assert np.allclose(list(found.values()), code, rtol=0.05)


def test_without_phases_of_a_second_band_no_multipath_is_claimed():
    """Oracle: (Q.2) needs both phases; a number of such a recording would be invented."""
    o = observed()
    values = o.values.copy()
    values[:, [k for k, name in enumerate(o.signals) if name.startswith("L2")]] = np.nan
    assert signals_of(replace(o, values=values)).multipath_m == {}


def test_cn0_is_the_median_by_band():
    """Oracle: 45 and 28 dB-Hz with noise of 1 dB."""
    found = signals_of(observed())
    assert signal_numbers(found)["cn0_dbhz"] == pytest.approx(
        {"band 1": 45.0, "band 2": 28.0}, abs=0.2
    )
    assert found.cn0_time.size == 60


def test_one_epoch_is_refused():
    """Oracle: the file's name in the error."""
    with pytest.raises(DataError, match=r"rover\.obs: 1 epoch"):
        signals_of(observed(epochs=1))


POS = """% program   : RTKLIB ver.EX 2.5.0
% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)
%  GPST                latitude(deg) longitude(deg)  height(m)   Q  ns \
  sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio
"""


def written(path, rows):
    """A .pos of (tow, quality, satellites, age, ratio) at one place."""
    line = (
        "2000 {:.9f} 46.500000000 6.500000000 500.0000 {:3d} {:3d} 0.0050 0.0050 0.0100 0.0010"
        " -0.0010 0.0010 {:6.2f} {:6.1f}\n"
    )
    path.write_text(POS + "".join(line.format(*row) for row in rows))
    return path


def test_columns_beside_the_positions_are_read_by_time(tmp_path):
    """Oracle: the rows written; the last stands twice, as engines write at the end of a file."""
    rows = [(1000.0, 1, 14, 0.1, 20.5), (1000.2, 2, 9, -0.3, 1.4), (1000.4, 5, 6, 0.0, 0.0)]
    solution = solution_of(read_pos_rows(written(tmp_path / "a.pos", [*rows, rows[-1]])))
    assert solution.fixes.quality.tolist() == [1, 2, 5]
    assert solution.satellites.tolist() == [14, 9, 6]
    assert solution.age_s.tolist() == [0.1, -0.3, 0.0]
    assert solution.ratio.tolist() == [20.5, 1.4, 0.0]


def test_a_pos_with_dates_is_read(tmp_path):
    """Oracle: the rows written; the second without covariance, which counts as single."""
    text = (
        POS + "2018/05/06 00:16:40.000   46.5 6.5 500.0 1 9 0.005 0.005 0.01 0.0 0.0 0.0 0.1 3.0\n"
    )
    text += "2018/05/06 00:16:41.000   46.5 6.5 500.0 1 8 0.0 0.0 0.01 0.0 0.0 0.0 0.2 4.0\n"
    (tmp_path / "a.pos").write_text(text)
    solution = solution_of(read_pos_rows(tmp_path / "a.pos"))
    assert solution.fixes.time.tolist() == [1000.0, 1001.0]
    assert solution.fixes.quality.tolist() == [1, 5]
    assert solution.satellites.tolist() == [9, 8]
    assert solution.ratio.tolist() == [3.0, 4.0]


def test_a_pos_without_what_an_engine_tells_is_refused(tmp_path):
    """Oracle: the missing column in the message."""
    path = written(tmp_path / "a.pos", [(1000.0, 1, 14, 0.1, 20.5)])
    path.write_text(
        path.read_text().replace("  ns ", " satellites ", 1).replace(" ns ", " satellites ")
    )
    with pytest.raises(InputError, match="ns"):
        solution_of(read_pos_rows(path))


LOST = range(100, 160)


@pytest.fixture
def solved(tmp_path):
    """200 epochs of 0.2 s, 60 in the middle of them float with few satellites; forward and backward
    agree.
    """
    rows = [
        (1000.0 + 0.2 * k, *((2, 7, 0.1, 1.2) if k in LOST else (1, 15, 0.1, 30.0)))
        for k in range(200)
    ]
    solution = solution_of(read_pos_rows(written(tmp_path / "a.pos", rows)))
    distance = np.full(200, 2000.0)
    separation = forward_backward(solution.fixes.time, solution.fixes, solution.fixes)
    fixes, kind = calibrate(solution.fixes, solution.satellites, distance, separation)
    return solution, fixes, kind, distance, separation


def numbers_of(solved, signals=None):
    solution, fixes, kind, distance, separation = solved
    numbers = solution_numbers(
        solution, fixes, kind, distance, np.full(200, 80.0), separation, 14.16
    )
    numbers |= coverage_numbers(
        solution.fixes.time, np.ones(200, dtype=bool), ~np.isin(np.arange(200), LOST)
    )
    return numbers | ({"signals": signal_numbers(signals)} if signals is not None else {})


def test_numbers_are_those_of_the_epochs(solved):
    """Oracle: the epochs of the fixture, counted by hand."""
    numbers = numbers_of(solved)
    assert numbers["engine_fixed"] == 140
    assert numbers["fix_rate"] == 0.7
    assert numbers["classes"]["fixed"] == 0
    assert numbers["classes"]["degraded"] == 140  # of the epochs around 30 % are not fixed
    assert numbers["sigma_m"]["fixed_median"] == pytest.approx([0.0321, 0.0321, 0.0566], abs=1e-4)
    assert numbers["classes"]["float"] == 50  # within 5 s of a fixed epoch
    assert numbers["classes"]["unsupported"] == 10
    assert numbers["satellites"] == {"median": 15.0, "least": 7}
    assert numbers["longest_without_fixed_s"] == pytest.approx(12.2)
    assert numbers["separation"]["contradicting"] == 0
    assert numbers["separation"]["fixed_rms_m"] == [0.0, 0.0, 0.0]


def test_the_verdict_says_what_to_look_at(solved):
    """Oracle: a fix rate of 70 %, 7 satellites, and a band of 28 dB-Hz."""
    told, checks = verdict(numbers_of(solved, signals_of(observed())))
    assert told.startswith(
        "poor: 70.0 % of 200 epochs are fixed and confirmed, 140 of them degraded"
    )
    assert "degraded fixes" in told.partition("look at")[2]
    assert "satellites" in told
    assert "C/N0" in told
    state = {check.name: check.verdict for check in checks}
    assert (
        state["GNSS fix rate"]
        == state["GNSS degraded fixes"]
        == state["GNSS satellites"]
        == state["GNSS C/N0"]
        == "note"
    )
    assert (
        state["GNSS forward and backward"]
        == state["GNSS base distance"]
        == state["GNSS gaps"]
        == "ok"
    )
    assert all(check.advice for check in checks if check.verdict != "ok")


@pytest.fixture
def fixed(tmp_path):
    """Numbers of 200 epochs that are all fixed, of 14 satellites, 2 km from the base."""
    rows = [(1000.0 + 0.2 * k, 1, 14, 0.1, 30.0) for k in range(200)]
    solution = solution_of(read_pos_rows(written(tmp_path / "a.pos", rows)))
    fixes, kind = calibrate(solution.fixes, solution.satellites, np.full(200, 2000.0))
    return solution_numbers(solution, fixes, kind, np.full(200, 2000.0), np.zeros(200), None, 14.16)


def of_epochs(count, without=()):
    """Coverage of `count` epochs of 0.2 s of which those `without` have no solution and the others
    are fixed.
    """
    solved = ~np.isin(np.arange(count), without)
    return coverage_numbers(1000.0 + 0.2 * np.arange(count), solved, solved)


def test_a_good_solution_is_called_good(fixed):
    """Oracle: all epochs fixed, 14 satellites, a base at 2 km."""
    told, checks = verdict(fixed | of_epochs(200))
    assert told.startswith("good: 100.0 % of 200 epochs")
    assert "degraded" not in told
    assert "no solution" not in told
    assert "look at" not in told
    assert {check.verdict for check in checks} == {"ok"}


def test_epochs_without_solution_count_as_not_fixed(fixed):
    """Oracle: 200 of 400 epochs, and 3 in two places of 203; the last epoch is that of the rover's
    file.
    """
    told, checks = verdict(fixed | of_epochs(400, range(200, 400)))
    assert told.startswith(
        "poor: 50.0 % of 400 epochs are fixed and confirmed, 200 have no solution"
    )
    assert "look at epochs" in told
    check = next(check for check in checks if check.name == "GNSS epochs")
    assert (check.verdict, check.found) == (
        "note",
        "200 of 400 epochs have no solution, from 1040.0 s to 1079.8 s",
    )
    numbers = of_epochs(203, [0, 7, 8])
    assert (numbers["unsolved"], numbers["unsolved_periods"]) == (3, 2)
    assert numbers["unsolved_s"] == pytest.approx([1001.4, 1001.6])
    assert numbers["unsolved_share"] == pytest.approx(3 / 203)
    assert numbers["longest_without_fixed_s"] == pytest.approx(0.6)
    assert verdict(fixed | numbers)[0].startswith("usable with care: 98.5 % of 203 epochs")


def test_a_doubt_of_the_base_or_a_contradiction_is_not_called_good(fixed):
    """Oracle: the checks that are told before; other notes leave the word as it is."""
    base, others = (
        Check("base coordinates", "6.5 m", "5 m", "note"),
        Check("navigation", "none of J", "all", "note"),
    )
    assert verdict(fixed | of_epochs(200), [others, Check("base point", "apc", "")])[0].startswith(
        "good"
    )
    told, _ = verdict(fixed | of_epochs(200), [others, base])
    assert told.startswith("usable with care: 100.0 % of 200 epochs")
    assert told.endswith("; look at base coordinates")
    told, _ = verdict(
        fixed | of_epochs(200), [Check("camera events", "-18 s", "0 s", "contradiction"), base]
    )
    assert told.endswith("; look at camera events, base coordinates")
    assert verdict(fixed | of_epochs(400, range(200, 400)), [base])[0].startswith("poor")


def test_series_hold_what_the_figures_draw(solved):
    """Oracle: the names that `report.gnss` reads."""
    solution, _, kind, distance, separation = solved
    series = solution_series(
        solution, kind, distance, np.full(200, 80.0), separation, signals_of(observed())
    )
    assert {
        "time",
        "kind",
        "satellites",
        "ratio",
        "distance_m",
        "separation_m",
        "separation_sigma_m",
        "cn0",
        "slip_time",
    } <= set(series)
    assert (series["kind"][[0, 150]] == [DEGRADED, FLOAT]).all()


def test_longest_time_without_a_good_epoch_counts_the_ends():
    """Oracle: by hand."""
    time = np.array([0.0, 1.0, 2.0, 5.0, 6.0])
    assert longest_without(time, np.array([False, False, True, True, False])) == 3.0
    assert longest_without(time, np.zeros(5, dtype=bool)) == 6.0
    assert longest_without(time, np.ones(5, dtype=bool)) == 3.0


def test_roots_of_no_covariance_become_unknown(tmp_path):
    """Oracle: rows as RTKLIB EX 2.5.0 wrote them of 30 s epochs with dynamics: zero and negative
    variances, correlations beyond one.
    """
    rows = [(1000.0 + 30.0 * k, 1, 7, 0.0, 50.0) for k in range(6)]
    lines = written(tmp_path / "a.pos", rows).read_text().splitlines()
    lines[4] = lines[4].replace("0.0050 0.0050 0.0100 0.0010", "0.0000 0.0000 322.9005 116.6826")
    lines[6] = lines[6].replace("0.0010 -0.0010 0.0010", "0.9280 1.1015 -0.4782")
    (tmp_path / "a.pos").write_text("\n".join(lines) + "\n")
    fixes = solution_of(read_pos_rows(tmp_path / "a.pos")).fixes
    assert fixes.quality.tolist() == [1, 5, 1, 5, 1, 1]
    assert np.allclose(
        np.sqrt(np.diagonal(fixes.cov_ned[[1, 3]], axis1=1, axis2=2)), [10.0, 10.0, 20.0]
    )
    assert np.allclose(
        np.sqrt(np.diagonal(fixes.cov_ned[[0, 2, 4, 5]], axis1=1, axis2=2)), [0.005, 0.005, 0.01]
    )
    assert [check.found.partition(":")[0] for check in fixes.notes] == [
        "2 epochs have no covariance"
    ]


def test_dilution_of_precision_is_that_of_the_geometry():
    """Oracle: closed form; one satellite in the zenith and three on the horizon give the root of
    8 / 3, twice as many of each divide it by root two, three satellites or four of one plane with
    the receiver give none.
    """
    azimuth, zenith = np.radians([0.0, 0.0, 120.0, 240.0]), np.radians([90.0, 0.0, 0.0, 0.0])
    epoch = np.concatenate([np.zeros(4), np.ones(8), np.full(3, 2), np.full(4, 3)]).astype(int)
    line = np.radians([10.0, 40.0, 60.0, 80.0])
    directions = (
        np.concatenate([azimuth, azimuth, azimuth, azimuth[:3], np.zeros(4)]),
        np.concatenate([zenith, zenith, zenith, zenith[:3], line]),
    )
    ones = np.ones(epoch.size)
    sky = Sky(epoch, *directions, np.zeros(epoch.size, dtype=np.int64), ones)
    dilution = position_dilution(sky, 5)
    np.testing.assert_allclose(dilution[:2], np.sqrt(8.0 / 3.0) / np.sqrt([1.0, 2.0]))
    assert np.isnan(dilution[2:]).all()
