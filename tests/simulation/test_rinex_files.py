"""RINEX 2.11 as the simulator writes it: column by column, and read back by others."""

import runpy
import tracemalloc
import warnings
from datetime import datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.base.errors import UsageError
from insgnss.gnss.rinex import navigation_message as message
from insgnss.gnss.rinex.navigation_message import Navigation, read_navigation
from insgnss.gnss.rinex.observations import read_observations
from insgnss.simulation.raw_gnss.rinex_files import (
    ObservationTable,
    Station,
    write_navigation,
    write_observations,
)

WRITTEN = SimpleNamespace(
    **runpy.run_path(str(Path(__file__).parents[1] / "gnss" / "written_rinex.py"))
)
TYPES = ("C1", "P2", "L1", "L2", "D1", "D2", "S1", "S2")
CODES = ("C1C", "C2W", "L1C", "L2W", "D1C", "D2W", "S1C", "S2W")
STATION = Station("rov0", (4.37e6, 5.0e5, 4.6e6), interval_s=0.1)
WEEK, TOW = 2008, 205200.0  # Tuesday 3 July 2018, 09:00 GPST
SKY = [f"G{k:02d}" for k in range(1, 15)]


def observed(time, per_epoch=14, types=TYPES, seed=1, blank=0.1, events=(), sky=SKY, **more):
    """A table of random numbers over all of F14.3, some missing, some with loss of lock."""
    rng = np.random.default_rng(seed)
    n, k = len(time), len(types)
    names = np.concatenate([np.sort(rng.choice(sky, per_epoch, replace=False)) for _ in range(n)])
    size = (n * per_epoch, k)
    values = rng.integers(-999_999_999, 9_999_999_999, size) + rng.integers(0, 1000, size) / 1e3
    small = rng.random(size) < 0.3
    values[small] = rng.uniform(-3.0, 3.0, small.sum())
    values[:, [name[0] == "S" for name in types]] = rng.uniform(
        0.0, 70.0, (len(names), sum(name[0] == "S" for name in types))
    )
    values[rng.random(size) < blank] = np.nan
    lock = rng.integers(0, 8, size).astype(np.int8) * (rng.random(size) < 0.2)
    epoch = np.repeat(np.arange(n), per_epoch)
    return ObservationTable(
        WEEK,
        np.asarray(time, dtype=float),
        epoch,
        names,
        types,
        values,
        lock,
        np.asarray(events, dtype=float),
        **more,
    )


def calendar(time):
    """Year to second of s of the week, the second to 1e-7."""
    ticks = round(time * 1e7)
    when = datetime(1980, 1, 6) + timedelta(weeks=WEEK, seconds=ticks // 10**7)
    return (
        when.year,
        when.month,
        when.day,
        when.hour,
        when.minute,
        when.second + ticks % 10**7 / 1e7,
    )


def strength(table, row, name):
    """The digit of RINEX 2.11 for S in dB-Hz."""
    band = f"S{name[1]}"
    s = (
        table.values[row, table.types.index(band)]
        if name[0] == "L" and band in table.types
        else np.nan
    )
    return " " if np.isnan(s) else str(min(max(int(s / 6), 1), 9))


def fields(table, row):
    """What `written_rinex` makes of a row: numbers with their two flags."""
    lock = [str(x) if x else " " for x in table.loss_of_lock[row].tolist()]
    return [
        None if np.isnan(x) else (x, a + strength(table, row, name))
        for x, a, name in zip(table.values[row].tolist(), lock, table.types, strict=True)
    ]


def body(path):
    """Lines behind the header without blanks at their ends."""
    lines = path.read_text("ascii").splitlines()
    return [
        text.rstrip()
        for text in lines[[text[60:].rstrip() for text in lines].index("END OF HEADER") + 1 :]
    ]


@pytest.mark.parametrize(
    "types", [TYPES, TYPES[:5], ("C1", "P1", "L1", "L2", "P2", "D1", "D2", "S1", "S2", "C5", "L5")]
)
def test_lines_are_those_of_the_columns(tmp_path, types):
    """Oracle: tests/gnss/written_rinex.py, which puts each line together from the format's columns:
    names over two lines, fields over one to three, blanks, flags, events before, between and behind
    the epochs, with records and without."""
    time = TOW + np.array([0.0, 0.1, 0.3, 59.9999999, 60.1234567])
    events = TOW + np.array([-1.0, 0.05, 0.0500001, 0.3, 61.0])
    records = (("8001.tif",), (), ("8003.tif", "a second line"), (), ("8005.tif",))
    table = observed(time, types=types, events=events, event_records=records)
    write_observations(tmp_path / "x.18o", STATION, table)
    pending = [
        WRITTEN.event2(calendar(when), records=[WRITTEN.record(text, "COMMENT") for text in lines])
        for when, lines in zip(events, records, strict=True)
    ]
    expected = ""
    for k, when in enumerate(time):
        early = int(np.sum(events <= when)) - (len(records) - len(pending))
        rows = np.flatnonzero(table.epoch == k)
        expected += "".join(pending[:early]) + WRITTEN.epoch2(
            calendar(when), {table.satellite[r]: fields(table, r) for r in rows}
        )
        pending = pending[early:]
    expected = (expected + "".join(pending)).splitlines()
    assert body(tmp_path / "x.18o") == [text.rstrip() for text in expected]
    assert max(map(len, (tmp_path / "x.18o").read_text().splitlines())) <= 80


def agrees(found, table):
    """That a file read back holds what was written: to the last of its digits, 0.001, of which zero
    is none.
    """
    number = np.round(table.values, 3)
    number[number == 0.0] = np.nan
    assert_array_equal(found.values[:, [found.column(code) for code in CODES]], number)
    lock = np.where(np.isfinite(table.values), table.loss_of_lock, 0)
    assert_array_equal(found.loss_of_lock[:, [found.column(code) for code in CODES]], lock)
    assert_array_equal(found.satellite, table.satellite)
    assert_array_equal(found.epoch, table.epoch)
    assert_allclose(found.time, table.time, rtol=0.0, atol=0.5e-7)


def test_reading_gives_back_what_was_written(tmp_path):
    """Oracle: `gnss.rinex`, which georinex and ten recordings bear out; several events between two
    epochs, more epochs than one piece.
    """
    events = np.sort(np.random.default_rng(5).uniform(TOW - 1.0, TOW + 70.0, 200))
    table = observed(TOW + 0.1 * np.arange(600), events=events)
    write_observations(tmp_path / "rov01840.18o", STATION, table)
    found = read_observations(tmp_path / "rov01840.18o")
    agrees(found, table)
    assert (found.gps_week, found.notes) == (WEEK, ())
    assert_allclose(found.events, events, rtol=0.0, atol=0.5e-7)
    head = found.header
    assert (
        head.version,
        head.system,
        head.clock,
        head.interval_s,
        head.leap_seconds,
        head.marker,
    ) == (2.11, "G", "GPS", 0.1, 18, "rov0")
    assert_array_equal(head.approx_position_m, STATION.position_m)


@pytest.mark.slow
def test_georinex_reads_the_same(tmp_path):
    """Oracle: georinex: values, loss of lock and strength of each satellite; full seconds, which
    its times keep.
    """
    georinex = pytest.importorskip("georinex")
    table = observed(
        TOW + np.arange(20.0), sky=[*SKY, *(f"R{k:02d}" for k in range(1, 9))], per_epoch=16
    )
    write_observations(tmp_path / "rov01840.18o", STATION, table)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of xarray and numpy, on how georinex calls them
        theirs = georinex.load(tmp_path / "rov01840.18o", useindicators=True)
    assert_array_equal(
        theirs.time.values.astype("datetime64[s]"),
        np.datetime64("2018-07-03T09:00:00") + np.arange(20),
    )
    column = {str(name).replace(" ", "0"): k for k, name in enumerate(theirs.sv.values)}
    at = table.epoch, np.array([column[name] for name in table.satellite])
    assert len(column) == 22
    for k, name in enumerate(TYPES):
        assert_array_equal(
            np.nan_to_num(theirs[name].values[at]),
            np.nan_to_num(np.round(table.values[:, k], 3)),
            err_msg=name,
        )
        if name[0] == "L":
            lock = np.where(np.isfinite(table.values[:, k]), table.loss_of_lock[:, k], 0)
            assert_array_equal(np.nan_to_num(theirs[f"{name}lli"].values[at]), lock)
            digits = [
                strength(table, r, name).strip() if np.isfinite(table.values[r, k]) else ""
                for r in range(table.epoch.size)
            ]
            digits = np.array([int(digit or 0) for digit in digits])
            assert_array_equal(np.nan_to_num(theirs[f"{name}ssi"].values[at]), digits)


def test_time_goes_on_over_the_end_of_the_week_and_rounds_into_the_next_minute(tmp_path):
    """Oracle: the calendar: week 2008 ends with Saturday 7 July 2018, and 59.99999996 s is the next
    minute to 1e-7 s.
    """
    table = observed([604799.9, 604859.99999996, 604860.2], blank=0.0)
    write_observations(tmp_path / "x.18o", STATION, table)
    stamps = [text[:26] for text in body(tmp_path / "x.18o") if text[1:3] == "18"]
    assert stamps == [
        " 18  7  7 23 59 59.9000000",
        " 18  7  8  0  1  0.0000000",
        " 18  7  8  0  1  0.2000000",
    ]
    assert (
        "  2018     7     7    23    59   59.9000000     GPS         TIME OF FIRST OBS"
        in (tmp_path / "x.18o").read_text()
    )
    assert_allclose(read_observations(tmp_path / "x.18o").time, table.time, rtol=0.0, atol=0.5e-7)


@pytest.mark.slow
def test_memory_does_not_grow_with_the_file(tmp_path):
    """Oracle: tracemalloc: a file of 12 MB is written with less than half of it in memory."""
    table = observed(TOW + 0.1 * np.arange(6000))
    tracemalloc.start()
    write_observations(tmp_path / "x.18o", STATION, table)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    size = (tmp_path / "x.18o").stat().st_size
    assert size > 11e6
    assert peak < 0.5 * size


def test_what_does_not_fit_is_refused_and_no_file_is_left(tmp_path):
    """Oracle: the columns: ten digits before the point, nine behind a minus; 60 letters of a
    record.
    """
    table = observed(TOW + 0.1 * np.arange(600), blank=0.0)
    for number, fits in (
        (9_999_999_999.999, True),
        (9_999_999_999.9996, False),
        (-999_999_999.999, True),
        (-1e9, False),
    ):
        table.values[-1, 2] = number
        if fits:
            write_observations(tmp_path / "y.18o", STATION, table)
            assert read_observations(tmp_path / "y.18o").of("L1C")[-1] == number
            continue
        with pytest.raises(
            UsageError, match=r"x.18o: G\d\d L1 .* at 205259.900 s is beyond the 14 columns"
        ):
            write_observations(tmp_path / "x.18o", STATION, table)
    with pytest.raises(UsageError, match="at most 60"):
        write_observations(
            tmp_path / "x.18o", STATION, observed([TOW], events=[TOW], event_records=(("x" * 61,),))
        )
    assert [path.name for path in tmp_path.iterdir()] == ["y.18o"]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"time": np.array([TOW, TOW + 1e-8])}, "times of epochs or events that fall"),
        ({"events": np.array([1.0, 0.0])}, "times of epochs or events that fall"),
        ({"epoch": np.repeat([1, 0], 14)}, "rows must follow"),
        ({"epoch": np.repeat([0, 2], 14)}, "rows must follow"),
        ({"satellite": np.array(["G01"])}, r"expected \(28,\)"),
        ({"event_records": (("a",),)}, "records of 1 events, but there are 0"),
    ],
)
def test_a_table_is_checked_at_birth(wrong, said):
    """Oracle: what a file can hold."""
    table = observed([TOW, TOW + 1.0])
    with pytest.raises(UsageError, match=said):
        ObservationTable(**{**vars(table), **wrong})


def messages():
    """Two GPS satellites at two times of ephemeris, the second in the next week, and a GLONASS one:
    random, of the right size.
    """
    rng = np.random.default_rng(8)
    table = np.zeros((4, message.MESSAGE_VALUES))
    for k, toe in enumerate((597600.0, 604800.0, 612000.0)):
        row = table[k]
        row[list(message.ORBIT_PLACES)] = rng.uniform(-1.0, 1.0, len(message.ORBIT_PLACES)) * 1e-6
        row[[message.ROOT_A, message.ECC, message.M0, message.NODE0]] = (
            5153.7,
            0.0123456789012,
            *rng.uniform(-np.pi, np.pi, 2),
        )
        row[[message.I0, message.AF0, message.AF2]] = 0.96, -1.234567890123e-4, 0.0
        row[[message.KIND, message.TOE, message.TOC, message.SOW]] = (
            message.KEPLER,
            toe,
            toe,
            toe % 604800.0,
        )
        row[[message.MU, message.RATE]] = message.CONSTANTS["G"]
    table[3, [message.KIND, message.TOE, message.TOC, message.AF0, message.AF1]] = (
        message.GLONASS,
        606618.0,
        606618.0,
        -3.1e-5,
        9.1e-13,
    )
    table[3, message.STATE : message.STATE + 9] = [
        1.1234567890123e7,
        -2.1e7,
        8.9e6,
        -1500.25,
        812.5,
        3000.0,
        1e-6,
        -2e-6,
        9.3e-7,
    ]
    return Navigation(np.array(["G05", "G31", "G05", "R07"]), table, np.array([0, 0, 0, -4]), WEEK)


def test_navigation_is_read_back(tmp_path):
    """Oracle: `gnss.navigation_message`, which RTKLIB and recordings bear out; twelve decimals of a
    power of ten.
    """
    navigation = messages()
    files = tmp_path / "rov01840.18n", tmp_path / "rov01840.18g"
    write_navigation(*files, navigation)
    found = read_navigation(files)
    order = np.argsort(navigation.table[:, message.TOE])
    assert (found.gps_week, found.left_out) == (WEEK, ())
    assert_array_equal(found.satellite, navigation.satellite[order])
    assert_array_equal(found.channel, navigation.channel[order])
    assert_allclose(found.table, navigation.table[order], rtol=5.1e-13, atol=0.0)


def test_navigation_stands_in_the_columns(tmp_path):
    """Oracle: tables A4 and A11 of RINEX 2.11, cut at their columns; week 2008 ends with 7 July,
    and GLONASS has UTC.
    """
    files = tmp_path / "rov01840.18n", tmp_path / "rov01840.18g"
    write_navigation(*files, messages())
    gps, glonass = (body(path) for path in files)
    assert len(gps) == 3 * 8
    assert len(glonass) == 4
    assert [line[:22] for line in gps[::8]] == [
        " 5 18  7  7 22  0  0.0",
        "31 18  7  8  0  0  0.0",
        " 5 18  7  8  2  0  0.0",
    ]
    assert glonass[0][:22] == " 7 18  7  8  0 30  0.0"
    cut = [[line[k : k + 19] for k in range(3, len(line), 19)] for line in gps[17:24]]
    row = messages().table[2]
    assert [cut[1][1], cut[1][3], cut[2][0]] == [
        " 1.234567890120D-02",
        " 5.153700000000D+03",
        " 7.200000000000D+03",
    ]
    assert [float(cut[4][2].replace("D", "E")), float(cut[6][0].replace("D", "E"))] == [
        2009.0,
        0.0,
    ]  # week of toe; sent 2 h before
    assert float(cut[0][3].replace("D", "E")) == pytest.approx(row[message.M0], rel=1e-12)
    assert gps[16][22:41] == "-1.234567890123D-04"
    orbit = [
        [float(line[k : k + 19].replace("D", "E")) for k in range(3, 79, 19)]
        for line in glonass[1:]
    ]
    expected = [
        [11234.567890123, -1.50025, 1e-9, 0.0],
        [-21000.0, 0.8125, -2e-9, -4.0],
        [8900.0, 3.0, 9.3e-10, 0.0],
    ]
    assert_allclose(orbit, expected, rtol=1e-12)
    assert (
        float(glonass[0][60:79].replace("D", "E")) == 900.0
    )  # the frame's time, a quarter of an hour before
    issues = [line[3:22] for line in gps[1::8]]
    assert (
        issues[0] != issues[2]
    )  # else an engine takes the second message of a satellite for the first


def test_georinex_reads_the_same_messages(tmp_path):
    """Oracle: georinex."""
    georinex = pytest.importorskip("georinex")
    navigation = messages()
    files = tmp_path / "rov01840.18n", tmp_path / "rov01840.18g"
    write_navigation(*files, navigation)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        gps, glonass = (georinex.load(path) for path in files)
    later = gps.sel(sv="G05").dropna("time", how="all").isel(time=-1)
    row = navigation.table[2]
    places = {
        "SVclockBias": message.AF0,
        "M0": message.M0,
        "sqrtA": message.ROOT_A,
        "Toe": message.SOW,
        "Cuc": message.CUC,
    }
    places |= {
        "Crs": message.CRS,
        "Omega0": message.NODE0,
        "omega": message.PERIGEE,
        "OmegaDot": message.NODE_DOT,
        "IDOT": message.I_DOT,
    }
    for name, column in places.items():
        assert float(later[name]) == pytest.approx(row[column], rel=1e-12), name
    seen = glonass.sel(sv="R07").isel(time=0)
    state = navigation.table[3, message.STATE : message.STATE + 9]  # georinex gives metres
    assert_allclose(
        [float(seen[name]) for name in ("X", "Y", "Z", "dX", "dY", "dZ", "dX2", "dY2", "dZ2")],
        state,
        rtol=1e-12,
    )
    assert (float(seen["FreqNum"]), str(seen.time.values)[:19]) == (-4.0, "2018-07-08T00:30:00")
