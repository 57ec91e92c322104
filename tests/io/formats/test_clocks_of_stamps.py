"""Stamps of clocks that were set, of counters that begin anew, and of dates that were not known."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from insgnss.base.errors import InputError
from insgnss.geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S
from insgnss.io.formats import read_barometer, read_events, read_gnss, read_imu
from insgnss.io.formats.logs.autopilot import Fixes, LogMessage
from insgnss.io.formats.text.clock import gps_time, on_one_clock, weeks_in_step
from insgnss.io.formats.text.order import NumberedRows, put_in_order

N, RATE_HZ = 3000, 100.0
VALUES = np.random.default_rng(3).normal(size=(N, 6))
COUNT = np.arange(N) / RATE_HZ
UNIX = GPS_EPOCH_UNIX_S + 2008 * WEEK_S + 205200.0 - 18.0
SHORT_LINES = NumberedRows("imu.csv", "line")


def imu_of(tmp_path: Path, stamps: np.ndarray, unit: str, form: str = "%.4f"):
    """The samples of a file with these stamps, in this unit."""
    path = tmp_path / "imu.csv"
    np.savetxt(path, np.column_stack([stamps, VALUES[: stamps.size]]), fmt=[form, *["%.6f"] * 6])
    return read_imu(path, units={"time": unit})


@pytest.mark.parametrize(
    ("modulus", "tick"),
    [(2.0**32, 1e-6), (2.0**32, 1e-4), (2.0**16, 1e-3), (2.0**32, 1e-3)],
    ids=["micros", "tenths", "words", "millis"],
)
@pytest.mark.parametrize("signed", [False, True])
def test_a_counter_that_begins_anew_is_counted_on(tmp_path, modulus, tick, signed):
    """Oracle: the count before it was taken modulo its range, from 15 s before its end."""
    clean = np.round(COUNT / tick) + (0.5 * modulus if signed else modulus) - round(15.0 / tick)
    ticks = (clean + 0.5 * modulus) % modulus - 0.5 * modulus if signed else clean % modulus
    tow, _, _, (told,) = on_one_clock(
        SHORT_LINES, ticks, None, f"{tick} s", "IMU rows", lambda i, k: False
    )
    np.testing.assert_allclose(tow, clean, atol=0.01)
    assert "restarts at imu.csv: line 1501" in told.found


def test_a_counter_in_a_file_and_a_week_are_counted_on(tmp_path):
    """Oracle: the instants; Arduino's micros, seconds made of them, and times of week."""
    first = 2.0**32 * 1e-6 - 12.0
    micros = np.round((first + COUNT) * 1e6) % 2**32
    for stamps, unit, form in (
        (micros, "us", "%.0f"),
        (micros * 1e-6, "s", "%.6f"),
        ((WEEK_S - 12.0 + COUNT) % WEEK_S, "s", "%.3f"),
    ):
        imu = imu_of(tmp_path, stamps, unit, form)
        np.testing.assert_allclose(imu.time - imu.time[0], COUNT, atol=2e-6)
    assert imu.notes == ()  # a week's end is no fault


@pytest.mark.parametrize("unit", ["unix", "s", "gps"])
@pytest.mark.parametrize("by_s", [-0.05, -0.37, -3.7, -9.99])
def test_a_clock_that_is_set_back_is_taken_as_set_right(tmp_path, unit, by_s):
    """Oracle: the instants before the first 11 s were stamped by a clock that is ahead."""
    start = {"unix": UNIX, "s": 205200.0, "gps": 2008 * WEEK_S + 205200.0}[unit]
    stamps = start + COUNT - by_s * (COUNT < 11.0)
    imu = imu_of(tmp_path, stamps, unit)
    np.testing.assert_allclose(imu.time, 205200.0 + COUNT, atol=2e-6)
    np.testing.assert_allclose(imu.gyro, VALUES[:, :3], atol=1e-6)
    (told,) = imu.notes
    assert f"once, by {by_s:+.3f} s at" in told.found
    assert "imu.csv:1101" in told.found


@pytest.mark.parametrize("by_s", [-0.5, 0.5, -3.7, 3.7])
def test_a_clock_that_is_set_and_put_right_again_is_taken_as_right(tmp_path, by_s):
    """Oracle: the instants before those from 10 s to 20 s were shifted."""
    stamps = UNIX + COUNT + by_s * ((COUNT >= 10.0) & (COUNT < 20.0))
    imu = imu_of(tmp_path, stamps, "unix")
    np.testing.assert_allclose(imu.time, 205200.0 + COUNT, atol=2e-6)
    assert "2 times" in imu.notes[0].found


@pytest.mark.parametrize("epoch_s", [0.0, GPS_EPOCH_UNIX_S, 946684800.0])
@pytest.mark.parametrize("rows", [1, 3, 700, 2500])
def test_rows_before_the_date_was_known_are_counted_back(tmp_path, epoch_s, rows):
    """Oracle: the instants before some of the first rows counted from 1970, 1980 or 2000."""
    stamps = np.where(np.arange(N) < rows, epoch_s + 25.0, UNIX) + COUNT
    imu = imu_of(tmp_path, stamps, "unix")
    np.testing.assert_allclose(imu.time, 205200.0 + COUNT, atol=2e-6)
    assert imu.gps_week == 2008
    assert f"imu.csv:{rows + 1}" in imu.notes[0].found


def test_recordings_of_two_days_in_one_file_are_no_set_clock(tmp_path):
    """Oracle: the stamps as they stand: which day the first rows are of is known."""
    stamps = UNIX + COUNT + 2.0 * 86400.0 * (COUNT >= 10.0)
    imu = imu_of(tmp_path, stamps, "unix")
    np.testing.assert_allclose(imu.time + UNIX - 205200.0, stamps, atol=2e-6)
    assert imu.notes == ()
    path = tmp_path / "gnss.txt"
    rows = np.column_stack([stamps[::100], np.full((30, 6), 6.5)])
    np.savetxt(path, rows, fmt="%.7f")
    assert len(read_gnss(path, units={"time": "unix"})) == 30


def test_seconds_since_power_up_before_the_week_was_known_are_counted_back(tmp_path):
    """Oracle: the instants before the first 500 rows counted since power-up."""
    stamps = np.where(np.arange(N) < 500, 25.0, 205200.0) + COUNT
    imu = imu_of(tmp_path, stamps, "s")
    np.testing.assert_allclose(imu.time, 205200.0 + COUNT, atol=2e-6)


def test_a_clock_that_forgets_the_date_in_between_counts_on(tmp_path):
    """Oracle: the instants before rows 1000 to 1999 counted from 1970, and the last ones."""
    for end in (2000, N):
        lost = (np.arange(N) >= 1000) & (np.arange(N) < end)
        imu = imu_of(tmp_path, np.where(lost, 0.0, UNIX) + COUNT, "unix")
        np.testing.assert_allclose(imu.time, 205200.0 + COUNT, atol=2e-6)


def test_a_clock_set_back_by_more_than_was_recorded_is_refused_with_both_causes(tmp_path):
    """Oracle: a zone's hour; rows of which none has the stamps of others may be out of order."""
    stamps = 205200.0 + COUNT - 3600.0 * (COUNT >= 11.0)
    with pytest.raises(InputError, match=r"imu.csv:1101: .*3600\.000 s to the rows.*if the clock"):
        imu_of(tmp_path, stamps, "s")


def test_fixes_before_the_date_was_known_are_left_out(tmp_path):
    """Oracle: the fixes without the three of 1980, whose second nobody knows."""
    path = tmp_path / "gnss.txt"
    unix = UNIX + 0.2 * np.arange(200)
    unix[:3] = GPS_EPOCH_UNIX_S + np.arange(3.0)
    rows = np.column_stack([unix, 46.5 + 1e-6 * np.arange(200), np.full((200, 5), 6.5)])
    np.savetxt(path, rows, fmt="%.7f")
    fixes = read_gnss(path, units={"time": "unix"})
    np.testing.assert_allclose(fixes.time, 205200.0 + 0.2 * np.arange(3, 200), atol=1e-6)
    np.testing.assert_allclose(np.degrees(fixes.lat), 46.5 + 1e-6 * np.arange(3, 200), atol=1e-9)
    assert "3 rows before" in fixes.notes[0].found


def fixes_of(path: Path, form: str, stamps: np.ndarray, mps: float):
    """Fixes at 5 Hz of a body on a wide arc, with stamps, s of week 2008, from a file of a form."""
    angle = mps / 200.0 * 0.2 * np.arange(stamps.size)
    north, east = 200.0 * np.sin(angle), 200.0 * (1.0 - np.cos(angle))
    lat, lon = 46.5 + np.degrees(north / 6.37e6), 6.5 + np.degrees(east / 4.4e6)
    columns = [lat, lon, 500.0 + 0.1 * np.sin(np.arange(stamps.size))]
    sigmas = [np.full(stamps.size, 0.02)] * 3
    if form == "pos":
        ones = [np.ones(stamps.size)] * 2
        names = "latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m)"
        sigmas += [np.zeros(stamps.size)] * 3
        table = np.column_stack([np.full(stamps.size, 2008), stamps, *columns, *ones, *sigmas])
        comments, names = "", f"%  GPST {names} sdne(m) sdeu(m) sdun(m)"
    else:
        table = np.column_stack([stamps, *columns, *sigmas])
        comments, names = "", "tow lat lon h sd_n sd_e sd_u"
    np.savetxt(path, table, fmt="%.9f", header=names, comments=comments)
    return read_gnss(path)


@pytest.mark.parametrize("form", ["txt", "pos"])
@pytest.mark.parametrize("by_s", [-40.0, -3.0, -0.8, 1.0, 18.0, 3600.0])
def test_fixes_of_a_clock_that_was_set_are_taken_as_set_right(tmp_path, form, by_s):
    """Oracle: the instants before the first 100 were stamped by a clock that lacks so much."""
    instants = 205200.0 + 0.2 * np.arange(300)
    stamps = instants - by_s * (np.arange(300) < 100)
    fixes = fixes_of(tmp_path / f"x.{form}", form, stamps, 12.0)
    np.testing.assert_allclose(fixes.time, instants, atol=1e-6)
    told = " ".join(check.found for check in fixes.notes)
    assert f"once, by {by_s:+.3f} s at" in told
    assert f"x.{form}:102" in told


@pytest.mark.parametrize("form", ["txt", "pos"])
def test_what_no_motion_shows_is_no_set_clock_of_fixes(tmp_path, form):
    """Oracle: a hovering drone whose fixes pause keeps its stamps, as does one that flies on; of
    a clock set back by more than was recorded nobody knows: the line is named."""
    paused = 205200.0 + 0.2 * np.arange(300) + 30.0 * (np.arange(300) >= 100)
    np.testing.assert_allclose(
        fixes_of(tmp_path / f"x.{form}", form, paused, 0.01).time, paused, atol=1e-6
    )
    k = np.concatenate([np.arange(100), np.arange(130, 300)])
    whole = fixes_of(tmp_path / f"y.{form}", form, 205200.0 + 0.2 * np.arange(300), 12.0)
    lines = (tmp_path / f"y.{form}").read_text().splitlines(keepends=True)
    (tmp_path / f"z.{form}").write_text("".join([lines[0], *(lines[1 + i] for i in k)]))
    np.testing.assert_array_equal(read_gnss(tmp_path / f"z.{form}").time, whole.time[k])
    back = 205200.0 + 0.2 * np.arange(300) - 90.0 * (np.arange(300) >= 100)
    with pytest.raises(InputError, match=rf"x.{form}:102: .*if the clock"):
        fixes_of(tmp_path / f"x.{form}", form, back, 0.01)


@pytest.mark.parametrize("date", ["1970/01/01", "1980/01/06", "1999/08/22"])
def test_rows_of_rtklib_before_the_date_was_known_are_left_out(tmp_path, date):
    """Oracle: the file without its first 20 rows."""
    rows = [
        f"{date if k < 20 else '2018/07/03'} 08:{k // 60:02d}:{k % 60:02d}.000 46.5 6.5"
        f" {500 + k} 1 9 0.02 0.02 0.03 0 0 0 0 9\n"
        for k in range(200)
    ]
    names = "%  GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m)"
    head = f"{names} sdne(m) sdeu(m) sdun(m) age(s) ratio\n"
    (tmp_path / "all.pos").write_text(head + "".join(rows))
    (tmp_path / "dated.pos").write_text(head + "".join(rows[20:]))
    fixes, dated = read_gnss(tmp_path / "all.pos"), read_gnss(tmp_path / "dated.pos")
    assert fixes.gps_week == dated.gps_week == 2008
    np.testing.assert_array_equal(fixes.time, dated.time)
    np.testing.assert_array_equal(fixes.height, dated.height)
    assert "20 rows before" in fixes.notes[0].found


def test_a_week_of_before_the_date_was_known_is_not_called_outdated():
    """Oracle: the first rows have another clock, too, so that no week makes their times right."""
    instants = 205200.0 + np.arange(100.0)
    week, tow = np.full(100, 2008.0), instants.copy()
    week[:20], tow[:20] = 1024.0, 36000.0 + np.arange(20.0)
    assert weeks_in_step(week, tow) is week
    _, _, undated, notes = on_one_clock(SHORT_LINES, tow, week, "s", "GNSS rows")
    assert undated == 20
    assert "20 rows before" in notes[0].found


@pytest.mark.parametrize("stale", [0, 1, 5, 9])
@pytest.mark.parametrize("named", [0.0, 2008.0, 2007.0])
def test_stale_weeks_are_taken_from_the_times_of_week(stale, named):
    """Oracle: instants over a week's end whose week is named late, as u-blox receivers do."""
    instants = WEEK_S - 2.0 + 0.2 * np.arange(40)
    week, tow = 2008.0 + instants // WEEK_S, instants % WEEK_S
    late = week.copy()
    late[10 : 10 + stale] = named
    assert np.array_equal(weeks_in_step(late, tow), week)
    path = NumberedRows("log.bin", "GPS")
    fixes = Fixes.of(LogMessage("GPS", {}, path), np.ones(40, dtype=bool), instants, late, tow)
    assert np.array_equal(fixes.week, week)
    assert len(fixes.left_out(40)) == bool(stale)
    tow, weeks, _, _ = on_one_clock(path, tow, late, "s", "GNSS rows")
    time, first = gps_time(path, tow, weeks, None)
    np.testing.assert_allclose(time + (first - 2008) * WEEK_S, instants, atol=1e-6)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.floats(-100.0, 1e5),
    st.integers(20, 580),
    st.sampled_from([50.0, 99.7, 128.0, 400.0]),
    st.sampled_from(["unix", "s"]),
)
def test_stamps_of_a_clock_that_was_set_come_back_or_are_refused(by_s, row, rate_hz, unit):
    """Oracle: the instants before those from one row on were shifted: they come back but for one
    constant, or with the step ahead that only motion tells from a pause, or are refused for it.
    """
    count = np.arange(600) / rate_hz
    stamps = (UNIX if unit == "unix" else 205200.0) + count + by_s * (np.arange(600) >= row)
    lines, different = NumberedRows("x", "line"), lambda i, k: False
    tow, week, _, notes = on_one_clock(lines, stamps, None, unit, "IMU rows", different)
    time, _ = gps_time(lines, tow, week, None, unit)
    step = np.diff(time)
    if notes:
        assert np.ptp(time - count) < 1e-4
    elif step.min() > 0.0:
        assert step[row - 1] == pytest.approx(by_s + 1.0 / rate_hz, abs=1e-5)
    elif by_s < -1.6 / rate_hz:  # less is jitter: two rows change places
        with pytest.raises(InputError, match="clock"):
            put_in_order(lines, time, different, "IMU rows")


def nmea(body: str) -> str:
    """A sentence with its checksum."""
    checksum = 0
    for letter in body:
        checksum ^= ord(letter)
    return f"${body}*{checksum:02X}\n"


@pytest.mark.parametrize("date", ["060180", "220899", "070419"])
@pytest.mark.parametrize("clock", [0, 36000, 86395])
@pytest.mark.parametrize("rmc_first", [True, False])
def test_sentences_before_the_date_was_known_are_left_out(tmp_path, date, clock, rmc_first):
    """Oracle: the fixes of the log without its first five seconds, whose date is a default."""
    text = []
    for k in range(40):
        second, day = (clock + k, date) if k < 5 else (36000 + k, "030725")
        time = f"{second // 3600:02d}{second // 60 % 60:02d}{second % 60:02d}.00"
        rmc = nmea(f"GNRMC,{time},A,4630.{k:04d},N,00630.0,E,0.0,0.0,{day},,,R")
        gga = nmea(f"GNGGA,{time},4630.{k:04d},N,00630.0,E,4,18,0.7,500.0,M,49.5,M,1.0,0001")
        gst = nmea(f"GNGST,{time},10,0.02,0.02,0,0.020,0.020,0.030")
        text.append((rmc + gga if rmc_first else gga + rmc) + gst)
    (tmp_path / "all.nmea").write_text("".join(text))
    (tmp_path / "dated.nmea").write_text("".join(text[5:]))
    fixes, dated = read_gnss(tmp_path / "all.nmea"), read_gnss(tmp_path / "dated.nmea")
    assert fixes.gps_week == dated.gps_week
    np.testing.assert_array_equal(fixes.time, dated.time)
    np.testing.assert_array_equal(fixes.lat, dated.lat)
    (told,) = [note.found for note in fixes.notes]
    assert told.startswith(f"5 rows before line {17 if rmc_first else 16} left out")


def test_logs_of_two_days_are_refused(tmp_path):
    """Oracle: no receiver's default is a day old: such a log has two flights."""
    text = ""
    for k, day in enumerate(["030725"] * 5 + ["050725"] * 5):
        text += nmea(f"GNRMC,10000{k}.00,A,4630.0,N,00630.0,E,0.0,0.0,{day},,,R")
        text += nmea(f"GNGGA,10000{k}.00,4630.0,N,00630.0,E,4,18,0.7,500.0,M,49.5,M,1.0,0001")
    (tmp_path / "x.nmea").write_text(text)
    with pytest.raises(InputError, match=r"x.nmea:11: date 050725 .*split the log by day"):
        read_gnss(tmp_path / "x.nmea", sigma_m=[0.1, 0.1, 0.1])


def test_events_heights_and_samples_of_one_counter_stay_together(tmp_path):
    """Oracle: the instants before the counter of all three began anew."""
    instants = 2.0**32 * 1e-6 - 100.0 + np.arange(0.0, 400.0, 2.5)
    micros = np.round(instants * 1e6) % 2**32
    (tmp_path / "events.txt").write_text(
        "".join(f"{k}.jpg {t:.0f}\n" for k, t in enumerate(micros))
    )
    (tmp_path / "h.txt").write_text("".join(f"{t:.0f} {k % 7}.0\n" for k, t in enumerate(micros)))
    events = read_events(tmp_path / "events.txt", units={"time": "us"})
    heights = read_barometer(tmp_path / "h.txt", units={"time": "us"})
    for record in (events, heights):
        np.testing.assert_allclose(record.time, instants, atol=1e-6)
        assert any("the time restarts" in note.found for note in record.notes)


def test_events_before_the_date_was_known_are_refused_by_line(tmp_path):
    """Oracle: nobody knows when two images of 1970 were taken."""
    stamps = [12.0, 15.0, *(UNIX + 3.0 * np.arange(20))]
    path = tmp_path / "events.txt"
    path.write_text("".join(f"{k}.jpg {stamp:.3f}\n" for k, stamp in enumerate(stamps)))
    with pytest.raises(
        InputError, match=r"events.txt:1: 2 rows were stamped before the clock knew the date"
    ):
        read_events(path, units={"time": "unix"})


@pytest.mark.parametrize("first", [0, 65536 - 700])
@pytest.mark.parametrize("step", [1, 4])
def test_a_packet_counter_shows_what_a_rate_hides(tmp_path, first, step):
    """Oracle: the instants before 20 and 1 packets were lost; without the counter none are."""
    kept = np.ones(N, dtype=bool)
    kept[500:520] = kept[2000] = False
    count = (first + step * np.arange(N)) % 65536
    path = tmp_path / "imu.csv"
    table = np.column_stack([count, VALUES])[kept]
    header = "PacketCounter gx[rad/s] gy[rad/s] gz[rad/s] ax[m/s^2] ay[m/s^2] az[m/s^2]"
    np.savetxt(path, table, fmt=["%05d", *["%.6f"] * 6], header=header, comments="")
    imu = read_imu(path, rate_hz=RATE_HZ)
    np.testing.assert_allclose(imu.time, COUNT[kept], atol=1e-9)
    assert "21 samples are lost by the count of packets, the first before" in imu.notes[-1].found
    assert "imu.csv:502" in imu.notes[-1].found
    np.savetxt(path, table, fmt=["%05d", *["%.6f"] * 6], header="x" + header, comments="")
    assert np.ptp(np.diff(read_imu(path, rate_hz=RATE_HZ).time)) < 1e-9


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    st.sampled_from([(2.0**32, "us"), (2.0**32, "0.1 ms"), (2.0**16, "ms"), (2.0**32, "ms")]),
    st.floats(0.0, 1.0),
    st.lists(st.floats(0.002, 0.5), min_size=30, max_size=90),
    st.booleans(),
)
def test_stamps_of_a_counter_come_back_wherever_it_begins_anew(counter, place, steps, even):
    """Oracle: the count before it was taken modulo its range, of rows as uneven as exposures."""
    modulus, unit = counter
    tick = {"us": 1e-6, "0.1 ms": 1e-4, "ms": 1e-3}[unit]
    instants = np.cumsum(np.full(len(steps), steps[0]) if even else steps)
    first = modulus * tick - place * instants[-1]
    ticks = np.round((first + instants) / tick)
    tow, _, undated, notes = on_one_clock(
        SHORT_LINES, ticks % modulus, None, unit, "rows", (lambda i, k: False) if even else None
    )
    np.testing.assert_allclose(np.diff(tow), np.diff(ticks), atol=0.01)
    assert undated == 0
    assert len(notes) == int((np.diff(ticks % modulus) < 0.0).any())
