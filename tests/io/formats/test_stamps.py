"""Stamps that are dates, and stamps that were printed with too few digits; refusals that count."""

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.io.formats import read_gnss, read_imu
from insgnss.io.formats.text.dates import seconds_of_dates
from insgnss.io.formats.text.stamps import spread_evenly, without_repetitions


def wandering(rate_hz, n=20000, drift=2e-6):
    """Instants of a sensor whose clock wanders by some parts in a million."""
    k = np.arange(n)
    return 1e5 + k / rate_hz + drift * np.sin(2.0 * np.pi * k / n) * n / rate_hz / 6.0


@pytest.mark.parametrize("rounded", [np.round, np.floor])
@pytest.mark.parametrize("rate_hz", [99.7, 128.0, 166.64, 397.0])
def test_rounded_stamps_are_spread_evenly(rate_hz, rounded):
    """Oracle: the instants, but for a constant that nothing shows: half of a digit where stamps are
    truncated, up to that where the rate is a simple fraction of the digit's.
    """
    time = wandering(rate_hz)
    time = np.delete(time, slice(7000, 7400))
    stamps = rounded(1e3 * time) / 1e3
    spread, (note,) = spread_evenly(stamps)
    late = np.mean(time - spread)
    assert abs(late) < 0.55e-3
    assert np.sqrt(np.mean((spread + late - time) ** 2)) < 0.06e-3
    assert np.abs(spread + late - time).max() < 0.3e-3
    assert "rounded to 1 ms" in note.found


def test_rows_that_share_a_rounded_stamp_are_all_kept(tmp_path):
    """Oracle: 100 Hz in stamps of 10 ms, one row in a hundred stamped a digit late or early."""
    rng = np.random.default_rng(4)
    time = np.round(20.0 + 0.01 * np.arange(6000), 2)
    stamps = time.copy()
    stamps[50::200] += 0.01
    stamps[150::200] -= 0.01
    table = np.column_stack([np.round(stamps, 2), rng.normal(size=(6000, 6))])
    path = tmp_path / "imu.csv"
    np.savetxt(path, table, fmt=["%.2f", *["%.6f"] * 6])
    imu = read_imu(path)
    np.testing.assert_allclose(imu.time, time, atol=1e-9)
    assert "60 stamps occur twice beside a missing stamp" in imu.notes[0].found


def test_rows_that_contradict_each_other_are_no_rounded_stamps():
    """Oracle: repeated stamps without a skipped one beside them, or far from it, stay."""
    stamps = np.round(20.0 + 0.01 * np.arange(6000), 2)
    for rows in (stamps, np.delete(stamps, 3000)):
        again = np.insert(rows, 4500, rows[4500])
        assert without_repetitions(again)[0] is again
        assert spread_evenly(again)[0] is again


def test_stamps_of_an_uneven_sensor_and_even_ones_stay():
    """Oracle: the stamps as they are: jitter is no rounding, and steps of 10 ms need nothing."""
    rng = np.random.default_rng(3)
    uneven = np.cumsum(rng.uniform(0.017, 0.023, 5000))
    late = np.unique(np.round(wandering(100.0) + np.abs(rng.normal(0.0, 1.5e-3, 20000)), 3))
    jittery = np.round(wandering(99.7) + 0.6e-3 * np.sin(np.arange(20000) / 9.0), 3)
    for stamps in (np.round(uneven, 3), late, jittery, 0.01 * np.arange(5000)):
        spread, notes = spread_evenly(stamps)
        assert spread is stamps
        assert notes == ()
    exact = wandering(128.0)
    assert spread_evenly(exact)[0] is exact


def test_samples_are_read_with_spread_stamps(tmp_path):
    """Oracle: the instants of a file with three decimals."""
    time = np.arange(2000) / 128.0
    path = tmp_path / "imu.csv"
    table = np.column_stack([time, np.zeros((2000, 5)), np.full(2000, -9.8)])
    np.savetxt(path, table, fmt=["%.3f", *["%.4f"] * 6])
    imu = read_imu(path)
    assert np.abs(imu.time - time).max() < 0.3e-3
    assert "spread evenly" in imu.notes[0].found


DATES = (
    ("2015_11_26_15_00_02_617", 1448550002.617),
    ("2015_11_26_15_00_02_5", 1448550002.005),
    ("2015-11-26T15:00:02.617Z", 1448550002.617),
    ("2015-11-26T15:00:02", 1448550002.0),
    ("2015/11/26-15:00:02.5", 1448550002.5),
    ("2015_11_26_15_00_02_617123", 1448550002.617123),
)


@pytest.mark.parametrize(("text", "seconds"), DATES)
def test_dates(text, seconds):
    """Oracle: date -u -d '2015-11-26 15:00:02' +%s, and that counts of three digits are ms."""
    assert seconds_of_dates([text])[0] == pytest.approx(seconds, abs=1e-6)
    assert seconds_of_dates([text, "nonsense"]) is None
    assert seconds_of_dates([text.replace("_11_", "_13_").replace("-11-", "-13-")]) is None or (
        "/" in text
    )


def test_fixes_with_dates_for_stamps(tmp_path):
    """Oracle: week 1872, Thursday 15:00:19 of GPS time, 17 leap seconds; the scale is told."""
    path = tmp_path / "g.txt"
    rows = [f"2015_11_26_15_00_{k:02d}_250,46.5{k},6.5,500.0,1,1,2" for k in range(2, 40)]
    path.write_text("time,lat,lon,h,sd_n,sd_e,sd_u\n" + "\n".join(rows) + "\n")
    fixes = read_gnss(path)
    assert fixes.gps_week == 1872
    assert fixes.time[0] == pytest.approx(4 * 86400.0 + 15 * 3600.0 + 2.25 + 17.0)
    assert any("taken as UTC" in note.found for note in fixes.notes)


@pytest.mark.parametrize(
    ("names", "stamp"),
    [
        ("time,lat,lon,h,sd_n,sd_e,sd_u", "2015-11-26T17:30:{:02d}.250+02:30"),
        ("time,lat,lon,h,sd_n,sd_e,sd_u", "2015-11-26T08:00:{:02d}.250-0700"),
        ("Date,time,lat,lon,h,sd_n,sd_e,sd_u", "2015/11/26,15:00:{:02d}.250"),
        ("time,Day,lat,lon,h,sd_n,sd_e,sd_u", "15:00:{:02d}.250,2015-11-26"),
    ],
)
def test_zones_are_taken_off_and_days_stand_beside_times_of_day(tmp_path, names, stamp):
    """Oracle: the same instants as one date in UTC, week 1872."""
    path = tmp_path / "g.txt"
    rows = [f"{stamp.format(k)},46.5{k},6.5,500.0,1,1,2" for k in range(2, 40)]
    path.write_text("\n".join([names, *rows]) + "\n")
    fixes = read_gnss(path)
    assert fixes.gps_week == 1872
    assert fixes.time[0] == pytest.approx(4 * 86400.0 + 15 * 3600.0 + 2.25 + 17.0)


@pytest.mark.parametrize("undated", [0, 30])
@pytest.mark.parametrize("fraction", ["UTC_Nano", "Millisecond", "Second"])
def test_a_date_in_columns_of_its_parts_is_a_clock(tmp_path, fraction, undated):
    """Oracle: numpy.datetime64; rows before the date was known, of year 0, are counted back."""
    start = np.datetime64("2018-12-31T23:59:50.000", "ms")
    stamps = start + (10 * np.arange(3000)).astype("timedelta64[ms]")
    rows = []
    for k, stamp in enumerate(stamps.astype(object)):
        parts = [stamp.year, stamp.month, stamp.day, stamp.hour, stamp.minute, stamp.second]
        parts = [0, 0, 0, 0, 0, k // 100] if k < undated else parts
        micros = 10000 * (k % 100) if k < undated else stamp.microsecond
        more = {"UTC_Nano": 1000 * micros, "Millisecond": micros // 1000, "Second": ""}[fraction]
        parts[5] = f"{parts[5] + 1e-6 * micros:.2f}" if fraction == "Second" else parts[5]
        rows.append("\t".join(map(str, [*parts, more or 0, *(0, 0, 0, 0, 0), -9.8 + 1e-6 * k])))
    names = ["UTC_Year", "UTC_Month", "UTC_Day", "UTC_Hour", "UTC_Minute", "UTC_Second"]
    names += [fraction if fraction != "Second" else "x", *["gx", "gy", "gz", "ax", "ay", "az"]]
    path = tmp_path / "imu.txt"
    path.write_text("\n".join(["\t".join(names), *rows]) + "\n")
    imu = read_imu(path, columns={**{n: n for n in names[7:]}, "tow": "UTC_Year"})
    assert imu.gps_week == 2034  # GPST is 18 s ahead: 2019-01-01 is a Tuesday
    seconds = (stamps - np.datetime64("2018-12-30")) / np.timedelta64(1, "s") + 18.0
    np.testing.assert_allclose(imu.time, seconds, rtol=0, atol=2e-6)
    assert not any("taken as UTC" in note.found for note in imu.notes)  # the names say it


@pytest.mark.parametrize("stamp", ["", "12.5 $"])
def test_lines_of_several_kinds_are_named(tmp_path, stamp):
    """Oracle: the words of the loggers' lines; a file of one kind with lines cut has none."""
    path = tmp_path / "log.txt"
    rows = [f"{stamp}VNIMU,{k},0.1,0.2,0.3,0.4,0.5,9.8" for k in range(300)]
    rows[5::10] = [f"{stamp}VNGPS,{k},46.5,6.5" for k in range(30)]
    path.write_text("\n".join(rows) + "\n")
    with pytest.raises(InputError, match="lines of 2 kinds, VNGPS, VNIMU: write each to a file"):
        read_imu(path)


def test_lines_of_another_length_are_counted(tmp_path):
    """Oracle: the lines that were cut here, one in ten."""
    path = tmp_path / "imu.csv"
    rows = [f"{0.01 * k:.2f},0,0,0,0,0,-9.8" for k in range(500)]
    rows[7::10] = [row[:8] for row in rows[7::10]]
    path.write_text("tow,gx,gy,gz,ax,ay,az\n" + "\n".join(rows) + "\n")
    with pytest.raises(InputError, match="50 of 500 lines have another number of fields than 7"):
        read_imu(path)
