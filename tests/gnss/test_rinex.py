"""Observations and events of RINEX 2 and 3, read as they stand."""

import gzip
import json
import re
from dataclasses import replace
from datetime import datetime, timedelta
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import written_rinex as w
from numpy.testing import assert_array_equal

from insgnss.base.errors import InputError
from insgnss.cli import main
from insgnss.geodesy.gpstime import gps_from_calendar
from insgnss.gnss.rinex import against_georinex
from insgnss.gnss.rinex.against_georinex import compare_with_georinex
from insgnss.gnss.rinex.header import codes_of, header_of, load_rinex
from insgnss.gnss.rinex.observations import read_observations

DATA = Path(__file__).parents[3] / "shared" / "data"
NOON = (2018, 10, 4, 12, 0, 0.0)
TOW = 4 * 86400 + 43200.0  # of NOON, a Thursday of week 2021
TYPES = ["C1", "L1", "D1", "S1", "P2", "L2", "D2", "S2"]
WIDE = {"G": ["C1C", "L1C", "D1C", "S1C"], "R": ["C1C", "L1C"]}


def at(second, minute=0):
    return (2018, 10, 4, 12, minute, second)


def reading(tmp_path, text, name="rover.18o"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_observations(path)


def rows_of(rng, satellites, count, blank=0.1):
    """Random fields, a few of them blank, with random flags."""
    out = {}
    for name in satellites:
        values = rng.integers(-999_999_999_999, 9_999_999_999_999, count) / 1000.0
        flags = rng.integers(0, 10, (count, 2))
        out[name] = [
            None if rng.random() < blank else (float(x), f"{a if a else ' '}{b if b else ' '}")
            for x, (a, b) in zip(values, flags, strict=True)
        ]
    return out


def expected(rows, width):
    """Values, loss of lock and strength of rows as the writer had them."""
    fields = [
        [cell if isinstance(cell, tuple) else (cell, "  ") for cell in row] for row in rows.values()
    ]
    number = np.array([[np.nan if x is None else round(x, 3) for x, _ in row] for row in fields])
    flags = np.array(
        [[[int(c) if c.strip() else 0 for c in flag] for _, flag in row] for row in fields]
    )
    return number.reshape(-1, width), flags[..., 0], flags[..., 1]


def test_a_file_of_version_2_is_read_as_it_was_written(tmp_path):
    """Oracle: what the writer was given: 14 satellites (two lines of them), 8 types (two lines a
    satellite), blanks, flags, clock.
    """
    rng = np.random.default_rng(1)
    satellites = [f"G{k:02d}" for k in range(1, 9)] + [f"R{k:02d}" for k in range(1, 7)]
    epochs = [rows_of(rng, satellites[: 14 - k], 8) for k in range(3)]
    text = w.header2(TYPES) + "".join(
        w.epoch2(at(0.1 * k), rows, clock=1e-9 * k if k else None) for k, rows in enumerate(epochs)
    )
    found = reading(tmp_path, text)
    assert found.signals == (
        "C1C",
        "L1C",
        "D1C",
        "S1C",
        "C2W",
        "L2W",
        "D2W",
        "S2W",
        "C2P",
        "L2P",
        "D2P",
        "S2P",
    )
    assert found.gps_week == 2021
    assert found.time.tolist() == [TOW, TOW + 0.1, TOW + 0.2]
    assert_array_equal(found.clock_offset_s, [np.nan, 1e-9, 2e-9])
    assert_array_equal(found.epoch, np.repeat([0, 1, 2], [14, 13, 12]))
    for k, rows in enumerate(epochs):
        mine = found.epoch == k
        assert found.satellite[mine].tolist() == list(rows)
        truth = expected(rows, 8)
        for array, want, missing in zip(
            (found.values, found.loss_of_lock, found.strength), truth, (np.nan, 0, 0), strict=True
        ):
            gps = np.char.startswith(found.satellite, "G")
            assert_array_equal(array[mine & gps][:, :8], want[:8])
            assert_array_equal(array[mine & ~gps][:, [0, 1, 2, 3, 8, 9, 10, 11]], want[8:])
            assert_array_equal(array[mine & gps][:, 8:], np.full((8, 4), missing))


def test_a_file_of_version_3_is_read_as_it_was_written(tmp_path):
    """Oracle: what the writer was given: 15 and 2 types, GLONASS phases among them, fields blank at
    the end of a line and within.
    """
    rng = np.random.default_rng(2)
    codes = [
        f"{kind}{band}{a}"
        for band, a in (("1", "C"), ("2", "W"), ("2", "L"), ("5", "Q"))
        for kind in "CLDS"
    ][:15]
    epochs = [rows_of(rng, ["G01", "G32"], 15) | rows_of(rng, ["R07"], 2) for _ in range(3)]
    epochs[1]["G01"][-3:] = [None] * 3
    text = w.header3({"G": codes, "R": ["C1C", "L1C"]}) + "".join(
        w.epoch3(at(0.2 * k), rows, k % 2, 0.25) for k, rows in enumerate(epochs)
    )
    found = reading(tmp_path, text)
    assert found.signals == tuple(codes)
    assert found.flag.tolist() == [0, 1, 0]
    assert found.clock_offset_s.tolist() == [0.25] * 3
    for k, rows in enumerate(epochs):
        mine = np.flatnonzero(found.epoch == k)
        value, lock, strength = expected({name: rows[name] for name in ("G01", "G32")}, 15)
        assert_array_equal(found.values[mine[:2]], value)
        assert_array_equal(found.loss_of_lock[mine[:2]], lock)
        assert_array_equal(found.strength[mine[:2]], strength)
        assert_array_equal(found.values[mine[2], :2], expected({"R07": rows["R07"]}, 2)[0][0])
        assert np.isnan(found.values[mine[2], 2:]).all()


@pytest.mark.parametrize("three", [False, True])
def test_every_stamp_is_the_double_nearest_to_what_is_written(tmp_path, three):
    """Oracle: exact fractions, for 10 Hz over 100 s and for random ticks of 1e-7 s."""
    rng = np.random.default_rng(3)
    ticks = sorted({*range(0, 10**9, 10**6), *rng.integers(0, 10**9, 500).tolist()})
    head, epoch = (w.header3({"G": ["C1C"]}), w.epoch3) if three else (w.header2(["C1"]), w.epoch2)
    text = head + "".join(
        epoch(at(tick % 600_000_000 / 1e7, tick // 600_000_000), {"G01": [1.0]}) for tick in ticks
    )
    found = reading(tmp_path, text)
    assert found.time.tolist() == [
        float(Fraction(int(TOW) * 10**7 + tick, 10**7)) for tick in ticks
    ]


@pytest.mark.parametrize("year", [1980, 1994, 1999, 2000, 2024, 2079])
def test_calendar_and_years_of_two_digits(tmp_path, year):
    """Oracle: the standard library's calendar; 80 to 99 are 1980 to 1999, 00 to 79 are 2000 to
    2079.
    """
    dates = [datetime(year, 1, 6, 1, 2, 3) + timedelta(days=k) for k in range(0, 330, 9)] + [
        datetime(year, 12, 31, 23, 59, 59)
    ]
    dates = [datetime(year, 2, 28), datetime(year, 2, 28) + timedelta(days=1), *dates]
    for date in dates:
        when = (date.year, date.month, date.day, date.hour, date.minute, float(date.second))
        week, tow = gps_from_calendar(date, "gpst")
        for text in (
            w.header2(["C1"]) + w.epoch2(when, {"G01": [1.0]}),
            w.header3({"G": ["C1C"]}) + w.epoch3(when, {"G01": [1.0]}),
        ):
            found = reading(tmp_path, text)
            assert (found.gps_week, found.time[0]) == (week, tow)


def test_time_goes_on_over_the_end_of_the_week(tmp_path):
    """Oracle: the convention of the package: seconds of the first week that count on; an event
    keeps to it.
    """
    saturday, sunday = (2018, 10, 6, 23, 59, 59.9), (2018, 10, 7, 0, 0, 0.0)
    text = (
        w.header2(["C1"])
        + w.epoch2(saturday, {"G01": [1.0]})
        + w.event2((2018, 10, 6, 23, 59, 59.95))
        + w.epoch2(sunday, {"G01": [1.0]})
    )
    found = reading(tmp_path, text)
    assert (found.gps_week, found.time.tolist(), found.events.tolist()) == (
        2021,
        [604799.9, 604800.0],
        [604799.95],
    )


@pytest.mark.parametrize(
    ("clock", "ahead"), [("GPS", 0.0), ("GAL", 0.0), ("BDT", 14.0), ("GLO", 18.0)]
)
def test_stamps_of_other_clocks_become_gps_time(tmp_path, clock, ahead):
    """Oracle: BDT = GPST - 14 s, UTC = GPST - 18 s in 2018."""
    found = reading(
        tmp_path,
        w.header3({"G": ["C1C"]}, clock=clock) + w.epoch3(NOON, {"G01": [1.0]}) + w.event3(at(0.5)),
    )
    assert found.time.tolist() == [TOW + ahead]
    assert found.events.tolist() == [TOW + 0.5 + ahead]
    assert found.notes == ()


def test_a_mixed_file_without_a_clock_says_so(tmp_path):
    """Oracle: the format, which demands one there."""
    found = reading(tmp_path, w.header3(WIDE, clock="") + w.epoch3(NOON, {"G01": [1.0]}))
    assert found.notes[0].name == "clock of the stamps"


@pytest.mark.parametrize("three", [False, True])
def test_events_are_kept_and_no_epoch_is_lost_behind_them(tmp_path, three):
    """Oracle: what was written: three events in one interval, one of them with record lines, one
    after the last epoch.
    """
    head, epoch, event = (
        (w.header3({"G": ["C1C"]}), w.epoch3, w.event3)
        if three
        else (w.header2(["C1"]), w.epoch2, w.event2)
    )
    line = w.record("CAMERA 1", "COMMENT")
    text = (
        head
        + epoch(at(0.0), {"G01": [1.0]})
        + event(at(0.0123456))
        + event(at(0.05), 5, [line, line])
        + event(at(0.0999999))
    )
    text += (
        epoch(at(0.1), {"G01": [2.0]}) + epoch(at(0.2), {"G01": [3.0]}) + event(at(0.25), 5, [line])
    )
    found = reading(tmp_path, text)
    assert found.time.tolist() == [TOW, TOW + 0.1, TOW + 0.2]
    assert found.of("C1C").tolist() == [1.0, 2.0, 3.0]
    assert found.events.tolist() == [TOW + 0.0123456, TOW + 0.05, TOW + 0.0999999, TOW + 0.25]
    assert [len(record.records) for record in found.records] == [0, 2, 0, 1]
    assert found.records[1].records[0].startswith("CAMERA 1")
    assert text.splitlines()[found.records[3].line - 1].rstrip().endswith("5  1")


def test_an_event_line_of_converters_in_use_is_read(tmp_path):
    """Oracle: lines as convbin writes them: an event without a stamp has no '>', and one blank
    before the flag instead of two.
    """
    plain = w.header3({"G": ["C1C"]}) + w.epoch3(NOON, {"G01": [1.0]})
    moves = f"{'':31}2  1\n" + w.record("rover", "MARKER NAME")
    text = (
        plain
        + moves
        + "> 2018 10  4 12  0  0.5000000 5  0\n"
        + "> 2018 10  4 12  0  1.0000000 0  1\nG01  20000000.000\n"
    )
    found = reading(tmp_path, text)
    assert [(record.flag, record.time) for record in found.records] == [(2, None), (5, TOW + 0.5)]
    assert found.of("C1C").tolist() == [1.0, 20000000.0]


def test_types_may_change_within_a_file(tmp_path):
    """Oracle: what was written before and behind an event 4, which announces other types and fewer
    lines a satellite.
    """
    many = ["C1", "L1", "D1", "S1", "P2", "L2", "D2", "S2", "C5", "L5", "S5"]
    text = w.header2(many) + w.epoch2(at(0.0), {"G01": [float(k + 1) for k in range(11)]})
    text += w.event2(None, 4, [w.types2(["S1", "C1", "C7"]), w.record("now otherwise", "COMMENT")])
    text += "".join(
        w.epoch2(at(1.0 + k), {f"G{s:02d}": [45.0, 2e7 + s, float(k)] for s in range(1, 15)})
        for k in range(60 - 1)
    )
    found = reading(tmp_path, text)
    assert found.time.size == 60
    assert found.values[0, :11].tolist() == [float(k + 1) for k in range(11)]
    assert np.isnan(found.values[0, 11:]).all()
    behind = found.epoch > 0
    assert (found.of("S1C")[behind] == 45.0).all()
    assert_array_equal(found.of("C1C")[behind], 2e7 + np.tile(np.arange(1, 15), 59))
    assert np.isnan(found.of("L2W")[behind]).all()
    assert found.of("C7X")[found.epoch == 59].tolist() == [58.0] * 14
    assert "# / TYPES OF OBSERV" in found.notes[0].found


def test_version_3_changes_the_types_of_one_system_only(tmp_path):
    """Oracle: what was written."""
    rows = {"G01": [1.0, 2.0, 3.0, 4.0], "R01": [5.0, 6.0]}
    text = w.header3(WIDE) + w.epoch3(at(0.0), rows) + w.event3(None, 4, [w.types3("R", ["L1P"])])
    found = reading(tmp_path, text + w.epoch3(at(1.0), {"G01": [1.0, 2.0, 3.0, 4.0], "R01": [7.0]}))
    assert_array_equal(found.of("L1P"), [np.nan, np.nan, np.nan, 7.0])
    assert_array_equal(found.of("L1C"), [2.0, 6.0, 2.0, np.nan])


def test_what_other_events_say_is_noted(tmp_path):
    """Oracle: what was written: the antenna starts to move, a site with another antenna height."""
    height = w.record(f"{1.5:14.4f}{0.0:14.4f}{0.0:14.4f}", "ANTENNA: DELTA H/E/N")
    text = w.header2(["C1"]) + w.event2(None, 2) + w.epoch2(NOON, {"G01": [1.0]})
    found = reading(
        tmp_path,
        text
        + w.event2(at(1.0), 3, [w.record("site2", "MARKER NAME"), height])
        + w.epoch2(at(2.0), {"G01": [2.0]}),
    )
    assert [(record.flag, record.time) for record in found.records] == [(2, None), (3, TOW + 1.0)]
    assert "the antenna starts to move" in found.notes[0].found
    assert "MARKER NAME, ANTENNA: DELTA H/E/N" in found.notes[1].found
    assert found.events.size == 0


@pytest.mark.parametrize("three", [False, True])
def test_cycle_slip_records_are_no_epoch(tmp_path, three):
    """Oracle: what was written: slips of 13 satellites between two epochs."""
    head, epoch = (
        (w.header3({"G": ["C1C", "L1C"]}), w.epoch3)
        if three
        else (w.header2(["C1", "L1"]), w.epoch2)
    )
    slips = {f"G{k:02d}": [None, float(k)] for k in range(1, 14)}
    text = (
        head
        + epoch(at(0.0), {"G01": [1.0, 2.0]})
        + epoch(at(1.0), slips, 6)
        + epoch(at(1.0), {"G01": [3.0, 4.0]})
        + epoch(at(1.5), slips, 6)
    )
    found = reading(tmp_path, text)
    assert found.time.tolist() == [TOW, TOW + 1.0]
    assert found.values.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert found.epoch.tolist() == [0, 1]


def test_zero_is_missing_and_scale_factors_are_taken_out(tmp_path):
    """Oracle: the format: 0.0 or blank where a value is missing; numbers are to be divided by their
    factor.
    """
    scale = w.record("G   10  1 L1C", "SYS / SCALE FACTOR")
    found = reading(
        tmp_path,
        w.header3(WIDE, scale)
        + w.epoch3(NOON, {"G01": [0.0, 1234.567], "R01": [(0.0, "1 "), 9.5]}),
    )
    assert_array_equal(found.values[:, :2], [[np.nan, 123.4567], [np.nan, 9.5]])
    assert found.loss_of_lock[1, 0] == 1


def test_a_blank_system_is_gps_and_a_blank_in_the_number_zero(tmp_path):
    """Oracle: the format's first example, written so."""
    text = (
        w.header2(["C1"], system="G")
        + " 05  4  2  0  0  0.0000000  0  3G 3  7G28\n"
        + "  20000000.000\n" * 3
    )
    assert reading(tmp_path, text).satellite.tolist() == ["G03", "G07", "G28"]


@pytest.mark.parametrize(
    ("system", "types", "codes"),
    [
        ("G", "C1 P1 L1 P2 L2 C2 S2 C5 L5", "C1C C1W L1C C2W L2W C2X S2W C5X L5X"),
        ("G", "P1 L1 D1 C2 L2", "C1W L1W D1W C2X L2X"),
        ("R", "C1 L1 P1 C2 L2", "C1C L1C C1P C2C L2C"),
        ("R", "C1 L1 P2 L2 C2", "C1C L1C C2P L2P C2C"),
        ("E", "C1 L1 C5 L5 C7 L8 C6", "C1X L1X C5X L5X C7X L8X C6X"),
        ("S", "C1 L1 C5", "C1C L1C C5X"),
        ("C", "C2 L2 C7 L7 C6 C1", "C2I L2I C7I L7I C6I C1"),
        ("G", "CA LA T1 C1", "CA LA T1 C1C"),
    ],
)
def test_codes_of_version_2(system, types, codes):
    """Oracle: the module's own table, written out by hand for what receivers list."""
    assert codes_of(2.11, system, types.split()) == tuple(codes.split())


def test_codes_of_version_2_12():
    """Oracle: RINEX 2.12: letters are L1 C/A, L1C, L2C and GLONASS L2 C/A, digits precise codes; a
    file of that version without letters is one of 2.11.
    """
    for system, types, codes in (
        ("G", "CA LA DA SA C1 L1 C2 L2 CC LC CB", "C1C L1C D1C S1C C1W L1W C2W L2W C2X L2X C1X"),
        ("R", "CA LA CD LD C2 L2", "C1C L1C C2C L2C C2P L2P"),
        ("E", "C1 L1 C5 L5 CA", "C1X L1X C5X L5X C1C"),
    ):
        assert codes_of(2.12, system, types.split()) == tuple(codes.split())
    assert codes_of(2.12, "G", ("C1", "P2", "L1", "L2")) == ("C1C", "C2W", "L1C", "L2W")


def test_version_4_is_read_as_version_3(tmp_path):
    """Oracle: the same file of version 3; RINEX 4.02 may add picoseconds behind the clock."""
    epochs = w.epoch3(NOON, {"G01": [2e7, 1e8, 1.0, 40.0]}, clock=1e-9)
    three = reading(tmp_path, w.header3(WIDE) + epochs)
    four = w.header3(WIDE, version="4.02") + epochs
    for text in (four, four.replace("0.000000001000", "0.000000001000 00123")):
        found = reading(tmp_path, text)
        assert_array_equal(found.values, three.values)
        assert found.clock_offset_s.tolist() == [1e-9]
        assert found.notes == ()


FREE = {  # an epoch line, and where its second stands
    "no leading zeros": "> 2018 10 4 12 0 {:.7f} 0 1",
    "blanks before": "  > 2018 10 04 12 00 {:.1f} 0 1",
    "a clock": "> 2018 10 4 12 0 {:.7f} 0 1 0.000000001000",
    "picoseconds": "> 2018 10 4 12 0 {:.7f} 0 1 0.000000001000 00123",
}


@pytest.mark.parametrize("kind", FREE)
def test_epoch_lines_beside_their_columns_are_read_and_counted(tmp_path, kind):
    """Oracle: the same file with its lines in columns; one epoch of three is as it must be."""
    rows = {"G01": [2e7, 1e8, 1.0, 40.0]}
    epochs = [w.epoch3(at(0.5 + k), rows) for k in range(3)]
    right = reading(tmp_path, w.header3(WIDE) + "".join(epochs))
    for k in (0, 2):
        epochs[k] = f"{FREE[kind].format(0.5 + k)}\n" + epochs[k].partition("\n")[2]
    found = reading(tmp_path, w.header3(WIDE) + "".join(epochs))
    assert found.time.tolist() == right.time.tolist() == [TOW + 0.5, TOW + 1.5, TOW + 2.5]
    assert_array_equal(found.values, right.values)
    (note,) = found.notes
    assert (note.name, note.verdict) == ("epoch lines", "note")
    assert note.found.startswith("2 whose numbers do not stand in their columns")
    clock = 1e-9 if "000000001" in FREE[kind] else np.nan
    assert_array_equal(found.clock_offset_s, [clock, np.nan, clock])


def test_blanks_and_a_closing_line_of_a_drone_are_stepped_over(tmp_path):
    """Oracle: the file without them: 14 kB of blanks behind the header, a closing line of text."""
    head, epoch = w.header3(WIDE), w.epoch3(NOON, {"G01": [2e7, 1e8, 1.0, 40.0]})
    for blanks in (" " * 14000 + "\n", (" " * 80 + "\n") * 175, " " * 14000):
        found = reading(tmp_path, head + blanks + epoch + "END OF RINEX OBS DATA\n")
        assert_array_equal(found.values, reading(tmp_path, head + epoch).values)


@pytest.mark.parametrize("three", [False, True])
def test_a_second_may_have_no_zero_before_its_point(tmp_path, three):
    """Oracle: the stamp: Fortran's F11.7 writes .0000000."""
    text = (
        w.header3({"G": ["C1C"]}) + w.epoch3(NOON, {"G01": [1.0]})
        if three
        else w.header2(["C1"]) + w.epoch2(NOON, {"G01": [1.0]})
    )
    for second, ticks in ((" .0000000", 0.0), (" .2500000", 0.25)):
        head, _, epoch = text.rpartition(" 0.0000000")
        assert reading(tmp_path, head + " " + second + epoch).time.tolist() == [TOW + ticks]
    with pytest.raises(InputError, match="where an epoch must begin"):
        reading(tmp_path, head + "         ." + epoch)


@pytest.mark.parametrize("moved", [-3, -1, 1, 2])
def test_a_time_system_beside_its_columns_is_read_with_a_note(tmp_path, moved):
    """Oracle: the time system that was written, in other columns than 49 to 51."""
    text = w.header2(["C1"], clock="GLO") + w.epoch2(NOON, {"G01": [1.0]})
    assert reading(tmp_path, text).notes == ()
    place = text.index("GLO")
    width = slice(place - 5, place + 8)
    shifted = text[: width.start] + f"{'':{5 + moved}}GLO".ljust(13) + text[width.stop :]
    found = reading(tmp_path, shifted)
    assert (found.header.clock, found.time.tolist()) == ("GLO", [TOW + 18.0])
    (note,) = found.notes
    assert note.found == "GLO does not stand in columns 49 to 51 of the header's record"


def test_codes_of_beidou_of_version_3_02():
    """Oracle: RINEX 3.03, which gives B1 the band 2 again."""
    assert codes_of(3.02, "C", ("C1I", "L1I", "C7I")) == ("C2I", "L2I", "C7I")
    assert codes_of(3.04, "C", ("C1X", "L1X")) == ("C1X", "L1X")


HEADER = (
    w.record("12345               RECEIVER            1.0", "REC # / TYPE / VERS")
    + w.record("678                 JAVRINGANT_DM   JVDM", "ANT # / TYPE")
    + w.record(" -3962108.2258-13381309.0271  3668678.5241", "APPROX POSITION XYZ")
    + w.record("        1.5000        0.0100       -0.0200", "ANTENNA: DELTA H/E/N")
    + w.record("     0.100", "INTERVAL")
    + w.record("    18", "LEAP SECONDS")
    + w.record("  3 R01  1 R02 -4 R13 -2", "GLONASS SLOT / FRQ #")
)


def test_the_header_says_what_is_in_it(tmp_path):
    """Oracle: the records, written by hand in their columns; the numbers of the position touch."""
    path = tmp_path / "x.rnx"
    path.write_text(w.header3(WIDE, HEADER) + w.epoch3(NOON, {"G01": [1.0]}))
    head = read_observations(path).header
    assert (head.version, head.system, head.clock, head.marker) == (3.04, "M", "GPS", "rover")
    assert (head.receiver, head.antenna) == ("RECEIVER", "JAVRINGANT_DM JVDM")
    assert head.approx_position_m.tolist() == [-3962108.2258, -13381309.0271, 3668678.5241]
    assert head.antenna_delta_m.tolist() == [1.5, 0.01, -0.02]
    assert (head.interval_s, head.leap_seconds) == (0.1, 18)
    assert head.glonass_slots == {"R01": 1, "R02": -4, "R13": -2}
    assert head.types == {"G": tuple(WIDE["G"]), "R": ("C1C", "L1C")}


def test_a_position_of_zeros_is_none(tmp_path):
    """Oracle: the format: zeros where it is not known."""
    path = tmp_path / "x.rnx"
    path.write_text(w.header2(["C1"], w.record(f"{0.0:14.4f}" * 3, "APPROX POSITION XYZ")))
    assert header_of(path, load_rinex(path)[0])[0].approx_position_m is None


GOOD = w.header2(TYPES) + "".join(
    w.epoch2(
        at(0.1 * k),
        {
            name: [2e7 + k, 1e8 + k, -5.5, 45.0, 2e7 - k, 8e7, -4.5, 40.25]
            for name in ("G01", "G02", "R03")
        },
    )
    for k in range(3)
)
GOOD3 = w.header3(WIDE) + "".join(
    w.epoch3(at(0.1 * k), {"G01": [2e7 + k, 1e8, -5.5, 45.0], "R03": [2e7, 1e8]}) for k in range(3)
)


@pytest.mark.parametrize("text", [GOOD, GOOD3], ids=["2", "3"])
def test_no_cut_of_a_file_goes_unsaid(tmp_path, text):
    """Oracle: the whole file: cut anywhere in its last epoch it is refused, or noted and all that
    was read is the whole's.
    """
    whole = reading(tmp_path, text)
    lines = text.splitlines(keepends=True)
    last = len("".join(lines[: -7 if text is GOOD else -3]))
    kept, said = 0, set()
    for cut in range(last + 1, len(text)):
        try:
            found = reading(tmp_path, text[:cut])
        except InputError as error:
            said.add(re.sub(r".*rover.18o:\d+: |'.*'|(?<=within ).*", "", str(error)).split(";")[0])
            continue
        kept += 1
        assert [note.name for note in found.notes] == ["end of the file"]
        same = found.values.shape[0]
        there = ~np.isnan(found.values)
        assert_array_equal(found.values[there], whole.values[:same][there])
    assert kept < 0.2 * (len(text) - last)
    assert said == {"truncated: the file ends within "}
    assert reading(tmp_path, text[:last]).time.size == 2


@pytest.mark.parametrize("text", [GOOD, GOOD3], ids=["2", "3"])
def test_no_damage_goes_further_than_a_refusal(tmp_path, text):
    """Oracle: the house's errors: with bytes changed, left out or put in anywhere a file is read or
    refused in one line.
    """
    rng = np.random.default_rng(8)
    refused = 0
    for _ in range(400):
        data = bytearray(text.encode())
        for place in rng.integers(0, len(data), rng.integers(1, 4)):
            kind = rng.integers(0, 3)
            data[place : place + int(kind != 0)] = bytes(
                rng.choice(list(b" 0159.-+GR>X\n\r\x00\xff"), int(kind != 2)).tolist()
            )
        try:
            found = reading(tmp_path, bytes(data))
        except InputError as error:
            refused += "\n" not in str(error)
        else:
            assert found.values.shape == (found.epoch.size, len(found.signals))
            assert (np.diff(found.time) > 0.0).all()
    assert refused > 100


def test_repeated_epochs_are_left_out_and_counted(tmp_path):
    """Oracle: the file without them."""
    rows = [{"G01": [1.0], "G02": [2.0 + k]} for k in range(3)]
    text = w.header2(["C1"]) + "".join(w.epoch2(at(float(k)), rows[k]) for k in (0, 1, 1, 2))
    found = reading(tmp_path, text)
    assert found.time.tolist() == [TOW, TOW + 1, TOW + 2]
    assert found.epoch.tolist() == [0, 0, 1, 1, 2, 2]
    assert found.of("C1C").tolist() == [1.0, 2.0, 1.0, 3.0, 1.0, 4.0]
    assert "1 double rows left out, of 4" in found.notes[0].found


@pytest.mark.parametrize("order", [(0, 1, 3, 2, 4), (0, 1, 2, 1, 3, 4), (1, 0, 2, 3, 4)])
def test_late_and_double_epochs_come_into_their_order(tmp_path, order):
    """Oracle: the file in order of time; two hundred epochs, as single ones are rare."""
    rest = [*range(5, 205)]
    times = {k: at(0.2 * k) for k in range(205)}
    rows = {k: {"G01": [1.0 + k], "R02": [2.0 + k]} for k in times}
    sorted_, mixed = (
        reading(tmp_path, w.header2(["C1"]) + "".join(w.epoch2(times[k], rows[k]) for k in ks))
        for ks in ((*range(5), *rest), (*order, *rest))
    )
    for name in ("time", "epoch", "satellite", "values", "flag"):
        assert_array_equal(getattr(mixed, name), getattr(sorted_, name))
    assert mixed.notes[0].found.startswith("1 ")


@pytest.mark.parametrize("by_s", [0.5, 0.6, 18.0])
@pytest.mark.parametrize("step_s", [0.2, 1.0])
def test_a_receiver_clock_that_was_set_back_is_named(tmp_path, by_s, step_s):
    """Oracle: the step that was planted; a file that was copied behind itself is none."""
    stamps = [step_s * k + (by_s if k < 100 else 0.0) for k in range(300)]
    rows = [
        w.epoch2(at(round(t % 60.0, 7), int(t // 60.0)), {"G01": [1.0 + k], "R02": [2.0 + k]})
        for k, t in enumerate(stamps)
    ]
    text = w.header2(["C1"]) + "".join(rows)
    if step_s > by_s - 1e-9:  # no stamp is met again
        assert reading(tmp_path, text).time.size == 300
        return
    error = rf"set back by {by_s:.3f} s here.* 100 epochs before and 200 behind"
    with pytest.raises(InputError, match=error):
        reading(tmp_path, text)
    twice = w.header2(["C1"]) + "".join(rows[100:]) + "".join(rows[100:])
    assert reading(tmp_path, twice).time.size == 200


def test_comments_and_blank_lines_between_epochs_are_stepped_over(tmp_path):
    """Oracle: the file without them."""
    one, two = (w.epoch2(at(float(k)), {"G01": [1.0 + k]}) for k in range(2))
    found = reading(
        tmp_path,
        w.header2(["C1"])
        + one
        + w.record("joined here", "COMMENT")
        + "\n"
        + two.replace("\n", "\r\n")
        + "\n",
    )
    assert found.of("C1C").tolist() == [1.0, 2.0]


NAVIGATION = w.record("     2.11           NAVIGATION DATA", "RINEX VERSION / TYPE")
FIRST = w.header2(["C1"]) + w.epoch2(NOON, {"G01": [1.0]})
FIRST3 = w.header3(WIDE) + w.epoch3(NOON, {"G01": [1.0]})
WRONG = {
    "empty": ("", "is empty"),
    "not RINEX": ("tow lat lon\n1 2 3\n", ":1: is not RINEX"),
    "binary": (bytes(range(256)) * 4, ":1: is not RINEX"),
    "RINEX 5": (
        w.header3(WIDE, version="5.00"),
        ":1: RINEX 5.00; versions 2 to 4 are read here; convert it to RINEX 3",
    ),
    "RINEX 1": (w.header2(["C1"], version="1"), ":1: RINEX 1; versions 2 to 4"),
    "navigation": (NAVIGATION, ":1: holds navigation data where observations must stand"),
    "navigation 3": (
        w.record("     3.04           N: GNSS NAV DATA    M", "RINEX VERSION / TYPE"),
        ":1: holds navigation data",
    ),
    "cut header": (w.header2(["C1"])[:-90], "truncated: the file ends without END OF HEADER"),
    "header cut in a record": (
        w.header2(["C1"])[:-130],
        ":4: truncated: the file ends within its header; copy it again",
    ),
    "header without a label": (
        w.header2(["C1"], w.record("1.0", "")),
        ":5: no header record: '1.0'",
    ),
    "no types": (
        w.header2([]).replace("     0", "      "),
        "the header has no # / TYPES OF OBSERV|fewer codes",
    ),
    "too few types": (
        w.header3({"G": ["C1C"]}).replace("G    1", "G    2"),
        "fewer codes|codes fewer",
    ),
    "no epoch": (w.header2(["C1"]), "holds no epoch"),
    "only events": (w.header2(["C1"]) + w.event2(NOON), "holds no epoch"),
    "bad number": (
        FIRST.replace("         1.000", "         1.0x0"),
        ":7: a field of 14 columns is no number",
    ),
    "no point": (
        FIRST.replace("         1.000", "          1000"),
        ":7: a field of 14 columns is no number",
    ),
    "more than the types": (
        FIRST.replace("         1.000", "         1.000           2.000"),
        ":7: .* there is text behind the last type",
    ),
    "bad month": (
        FIRST + w.epoch2((2018, 13, 4, 12, 0, 1.0), {"G01": [1.0]}),
        ":8: .* where an epoch must begin",
    ),
    "30 February": (
        FIRST + w.epoch2((2018, 2, 30, 12, 0, 1.0), {"G01": [1.0]}),
        ":8: .* where an epoch must begin",
    ),
    "unknown flag": (
        FIRST + w.epoch2(at(1.0), {"G01": [1.0]}, 7),
        ":8: .* where an epoch must begin",
    ),
    "bad satellite": (FIRST + w.epoch2(at(1.0), {"X01": [1.0]}), ":8: .* names no satellite"),
    "bad satellite 3": (
        FIRST3 + w.epoch3(at(1.0), {"G 1": [1.0], "Gxx": [1.0]}),
        "names no satellite of the epoch in line",
    ),
    "satellite twice": (
        FIRST3 + w.epoch3(at(1.0), {"G01": [1.0], "G 1": [1.0]}),
        "this satellite stands twice",
    ),
    "system without types": (
        FIRST3 + w.epoch3(at(1.0), {"E01": [1.0]}),
        "the header lists no types of observation of Galileo",
    ),
    "time falls": (
        FIRST + w.epoch2((2018, 10, 4, 11, 0, 0.0), {"G01": [1.0]}),
        ":8: time 385200.000000 s follows 388800.000000 s; time must increase; 1 of 2 rows are out",
    ),
    "same time": (
        FIRST + w.epoch2(NOON, {"G01": [2.0]}),
        ":8: time 388800.000000 s follows 388800.000000 s with other values",
    ),
    "two headers": (FIRST + FIRST, ":8: a second header"),
    "event swallows an epoch": (
        FIRST3 + w.event3(at(0.5))[:-2] + "1\n" + w.epoch3(at(1.0), {"G01": [1.0]}),
        "correct the event's number of records",
    ),
    "event swallows fields": (
        FIRST
        + f"{w.stamp2(None)}  3  2\n"
        + w.record("x", "MARKER NAME")
        + w.epoch2(at(1.0), {"G01": [1.0]}),
        "correct the event",
    ),
    "event cut": (
        FIRST + f"{w.stamp2(at(0.5))}  5  2\n" + w.record("x", "COMMENT"),
        "truncated: 1 of 2 records",
    ),
    "event without stamp": (FIRST + w.event2(None), "an external event without a stamp"),
    "unknown clock": (w.header2(["C1"], clock="UTC"), "time system 'UTC' is none of"),
    "bad position": (
        w.header2(["C1"], w.record("  1.0 x 2.0", "APPROX POSITION XYZ")),
        "APPROX POSITION XYZ: .* expected 3 numbers",
    ),
    "cut packed": (gzip.compress(GOOD.encode())[:200], "cannot be unpacked"),
}


@pytest.mark.parametrize("kind", WRONG)
def test_what_is_wrong_is_refused_in_one_line(tmp_path, kind):
    """Oracle: the fault that was put in, with its line."""
    text, message = WRONG[kind]
    if kind == "cut packed":
        pytest.importorskip("hatanaka", reason="hatanaka is not installed")
    with pytest.raises(InputError, match=message) as refused:
        reading(tmp_path, text)
    assert "\n" not in str(refused.value)
    assert "rover.18o" in str(refused.value)


def test_a_file_that_is_not_there(tmp_path):
    """Oracle: the file system."""
    with pytest.raises(InputError, match="no such file"):
        read_observations(tmp_path / "none.18o")


def same_observations(one, other):
    for name in (
        "time",
        "flag",
        "clock_offset_s",
        "epoch",
        "satellite",
        "values",
        "loss_of_lock",
        "strength",
        "events",
    ):
        assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    assert one.signals == other.signals
    assert [record.records for record in one.records] == [
        record.records for record in other.records
    ]


@pytest.mark.parametrize("three", [False, True])
@pytest.mark.parametrize("form", ["gz", "Z", "crx", "crx.gz"])
def test_packed_files_are_the_plain_ones(tmp_path, form, three):
    """Oracle: the plain file, with events and flags."""
    hatanaka = pytest.importorskip("hatanaka", reason="hatanaka is not installed")
    rng = np.random.default_rng(5)
    head, epoch, event = (
        (w.header3(WIDE), w.epoch3, w.event3)
        if three
        else (w.header2(TYPES[:4]), w.epoch2, w.event2)
    )
    rows = [
        {
            "G01": [2e7 + k, (1e8 + k, "1 "), None, 45.0],
            "R02": [2e7 - k, (rng.integers(10**8) / 8, " 7")],
        }
        for k in range(4)
    ]
    text = (
        head
        + epoch(at(0.0), rows[0])
        + event(at(0.5), 5, [w.record("shot", "COMMENT")])
        + "".join(epoch(at(1.0 + k), rows[k]) for k in range(1, 4))
    )
    plain = reading(tmp_path, text)
    data = text.encode()
    if "crx" in form:
        data = hatanaka.rnx2crx(data)
    data = gzip.compress(data) if form.endswith("gz") else data
    if form == "Z":
        data = hatanaka.compress(b" " * 0 + data, compression="Z")
    same_observations(reading(tmp_path, data), plain)


def test_a_cut_compact_file_is_refused(tmp_path):
    """Oracle: the cut."""
    hatanaka = pytest.importorskip("hatanaka", reason="hatanaka is not installed")
    data = hatanaka.rnx2crx(GOOD.encode())
    for cut in (len(data) - 5, len(data) - 30, len(data) // 2):
        with pytest.raises(InputError, match=r"cannot be unpacked|truncated"):
            reading(tmp_path, data[:cut])


def agrees_with_georinex(path):
    """All that both read: values and flags bit by bit, number of epochs; and number of values."""
    pytest.importorskip("georinex")
    compared = compare_with_georinex(path)
    assert compared.passed, compared.summary()
    assert compared.epochs == compared.their_epochs
    assert compared.total("ours_alone") == 0
    assert compared.flags > 0
    return compared.total("shared")


@pytest.mark.slow
def test_what_two_readers_have_otherwise_is_a_difference(tmp_path, monkeypatch, capsys):
    """Oracle: a number, a flag and an epoch that were changed behind the back of one reader."""
    pytest.importorskip("georinex")
    path = tmp_path / "rover.obs"
    rows = {"G01": [2e7, (1e8, "1 "), 1.0, 40.0], "R02": [2e7, None]}
    path.write_text(w.header3(WIDE) + "".join(w.epoch3(at(float(k)), rows) for k in range(3)))
    assert main(["verify", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["passed"], found["epochs"], found["their_epochs"]) == (True, 3, 3)
    good = read_observations(path)
    value, lock = good.values.copy(), good.loss_of_lock.copy()
    value[2, good.column("L1C")] += 0.001
    lock[2, good.column("L1C")] = 0
    first = np.array([True, True, False])
    for one, counts in (
        (replace(good, values=value), (15, 1, 0, 0)),
        (replace(good, loss_of_lock=lock), (15, 0, 0, 1)),
        (good.only(first), (10, 0, 5, 0)),
    ):
        monkeypatch.setattr(against_georinex, "read_observations", lambda _, one=one: one)
        compared = compare_with_georinex(path)
        totals = tuple(compared.total(name) for name in ("shared", "different", "theirs_alone"))
        assert (*totals, compared.different_flags) == counts
        assert main(["verify", str(path)]) == 4
        out, err = capsys.readouterr()
        assert "DO NOT AGREE" in out
        assert err.count("\n") == 1


@pytest.mark.parametrize("three", [False, True])
def test_random_files_agree_with_georinex(tmp_path, three):
    """Oracle: georinex, another reader: every value and flag, bit by bit."""
    rng = np.random.default_rng(6)
    head, epoch = (
        (w.header3({"G": TYPES_3, "R": TYPES_3[:5]}), w.epoch3)
        if three
        else (w.header2(TYPES), w.epoch2)
    )
    sky = [f"G{k:02d}" for k in range(1, 20)] + [f"R{k:02d}" for k in range(1, 8)]
    text = head
    for k in range(12):
        seen = sorted(rng.choice(sky, 18, replace=False).tolist())
        rows = {
            name: rows_of(rng, [name], 5 if three and name[0] == "R" else 8)[name] for name in seen
        }
        text += epoch(at(float(k)), rows)
    path = tmp_path / ("rand2770.18o" if not three else "RAND00XXX_R_20182771200_01M_01S_MO.rnx")
    path.write_text(text)
    assert agrees_with_georinex(path) > 1200


TYPES_3 = ["C1C", "L1C", "D1C", "S1C", "C2W", "L2W", "D2W", "S2W"]


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("rtklib_gsi_static/07590920.05o", 3740),
        ("rtklib_gsi_static/30400920.05o", 4150),
        ("rinex_sim_6min/base.18o", 57840),
        ("cssrlib_rtk/SEPT078M1.21O", 15000),
    ],
)
@pytest.mark.slow
def test_recordings_agree_with_georinex(name, count):
    """Oracle: georinex, on real files of several receivers; its times apart, which are early where
    a stamp is no whole second.
    """
    if not (DATA / name).is_file():
        pytest.skip(f"the recording {name} is not here")
    assert agrees_with_georinex(DATA / name) >= count


def test_events_of_the_simulated_flight():
    """Oracle: the instants that the simulation wrote beside its file, to the 0.1 microsecond of a
    stamp.
    """
    if not (DATA / "rinex_sim_6min").is_dir():
        pytest.skip("the recording rinex_sim_6min is not here")
    found = read_observations(DATA / "rinex_sim_6min" / "rover.18o")
    truth = np.load(DATA / "rinex_sim_6min" / "truth.npz")
    np.testing.assert_allclose(found.events, truth["events"], rtol=0.0, atol=1e-7)
    assert_array_equal(found.time, np.round(392700.0 + 0.1 * np.arange(3601), 7))
