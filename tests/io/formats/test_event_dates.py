"""Exposures by dates, of RTKLIB's time marks and of Exif: scale, digits, refusals."""

from datetime import datetime

import numpy as np
import pytest
from photographs import photograph

from insgnss.base.errors import InputError, UsageError
from insgnss.geodesy.gpstime import gps_from_calendar
from insgnss.io.exposures.naming import events_of
from insgnss.io.formats import read_events, sniff_events
from insgnss.navigation.filter.event_clock import at_uncertain_times
from insgnss.records import Trajectory

WEEK, TOW = gps_from_calendar(datetime(2021, 3, 18, 12, 19, 4), "utc")


def table(tmp_path, text):
    path = tmp_path / "events.csv"
    path.write_text(text)
    return path


ROWS = "a.jpg,2021-03-18 12:19:04.623{0}\nb.jpg,2021-03-18 12:19:06.323{0}\n"


@pytest.mark.parametrize(
    ("text", "scale", "late_s"),
    [
        ("file,UTC\n" + ROWS.format(""), None, 0.0),
        ("file,time\n" + ROWS.format("Z"), None, 0.0),
        ("file,time\n" + ROWS.format("+02:00"), None, -7200.0),
        (ROWS.format(""), "utc", 0.0),
        (ROWS.format(""), "gpst", -18.0),
        (ROWS.format(""), "utc-3:30", 12600.0),
        ("file,GPST\n" + ROWS.format(""), None, -18.0),
        (ROWS.format("").replace("-03-18 ", ":03:18 "), "utc", 0.0),
        (ROWS.format("").replace("2021-03-18 ", "2021/03/18,"), "utc", 0.0),
        ("Foto;Zeit\n" + ROWS.format("").replace(",2021-03-18", ";18.03.2021"), "utc", 0.0),
        (ROWS.format("").replace("2021-03-18 ", "18.3.2021,"), "utc", 0.0),
        (
            "SourceFile,CreateDate,SubSecTime\n./x/a.jpg,2021:03:18 12:19:04,623\n"
            "./x/b.jpg,2021:03:18 12:19:06,323\n",
            "utc",
            0.0,
        ),
        (
            "SourceFile,DateTimeOriginal,SubSecDateTimeOriginal\n"
            "./x/a.jpg,2021:03:18 12:19:04,2021:03:18 12:19:04.623\n"
            "./x/b.jpg,2021:03:18 12:19:06,2021:03:18 12:19:06.323\n",
            "utc",
            0.0,
        ),
    ],
)
def test_dates_are_of_the_scale_that_is_stated(tmp_path, text, scale, late_s):
    """Oracle: the calendar, 18 leap seconds in 2021."""
    path = table(tmp_path, text)
    assert sniff_events(path) == "event_dates"
    events = read_events(path, time_scale=scale)
    assert events.images == ("a.jpg", "b.jpg")
    assert events.gps_week == WEEK
    np.testing.assert_allclose(events.time, TOW + late_s + np.array([0.623, 2.323]), atol=1e-6)
    assert events.sigma_s is None


def test_a_time_of_week_goes_before_a_date(tmp_path):
    """Oracle: the column of the file that is a time of GPS already."""
    path = table(tmp_path, "image,tow,date\na.jpg,1000.5,2021-03-18 12:19:04\n")
    assert sniff_events(path) == "events"
    assert read_events(path).time.tolist() == [1000.5]


def test_nothing_is_guessed(tmp_path):
    """Oracle: the message names the key, and what it may be."""
    path = table(tmp_path, ROWS.format(""))
    with pytest.raises(InputError, match=r":1: dates do not say .* camera.time_scale: .*utc"):
        read_events(path)
    with pytest.raises(UsageError, match="'local' is unknown"):
        read_events(path, time_scale="local")
    with pytest.raises(InputError, match=r":2: .*where date and time must stand"):
        read_events(table(tmp_path, ROWS.format("").replace("12:19:06.323", "noon")))


@pytest.mark.parametrize(
    "stamp",
    [
        *(
            "2021-03-18 12:19:75",
            "2021-03-18 12:19:04.5%",
            "2021-03-18 12:19:04+99:00",
            "1970-01-02 00:00:00",
        ),
        *(
            "2021-03-18 12:19:04+02:75",
            "9999-12-31 23:59:60",
            "\N{ARABIC-INDIC DIGIT TWO}021-03-18 12:19:04",
        ),
    ],
)
def test_a_date_that_is_none_is_named(tmp_path, stamp):
    """Oracle: minutes have 60 seconds and a leap second, offsets are up to 14 hours."""
    path = table(tmp_path, f"a.jpg,2021-03-18 12:19:04\nb.jpg,{stamp}\n")
    with pytest.raises(InputError, match=r":2: .*"):
        read_events(path, time_scale="utc")


def test_a_leap_second_is_a_time(tmp_path):
    """Oracle: the second after 23:59:59 of 2016-12-31 was called 60."""
    path = table(tmp_path, "a.jpg,2016-12-31 23:59:59.50\nb.jpg,2016-12-31 23:59:60.50\n")
    events = read_events(path, time_scale="gpst")
    assert np.diff(events.time).tolist() == [1.0]


@pytest.mark.parametrize(
    ("fraction", "sigma", "late_s"),
    [("", 0.2887, 0.5), (".6", 0.02887, 0.6), (".623", None, 0.623)],
)
def test_few_digits_are_uncertain_times(tmp_path, fraction, sigma, late_s):
    """Oracle: the standard deviation of an even distribution over the last digit."""
    path = table(tmp_path, f"a.jpg,2021-03-18 12:19:04{fraction}\n")
    events = read_events(path, time_scale="utc")
    assert events.time[0] == pytest.approx(TOW + late_s, abs=1e-6)
    if sigma is None:
        assert events.sigma_s is None
    else:
        assert events.sigma_s[0] == pytest.approx(sigma, rel=1e-3)
        assert any(check.name == "exposure times" for check in events.notes)


POS = """% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,5:single,ns=# of satellites)
%  {}                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m) \
 sdne(m)  sdeu(m)  sdun(m) age(s)  ratio
2021/03/18 12:19:04.623   46.848703631   6.489500183   346.9086   1  16   0.0051   0.0037   0.0083 \
  0.0012  -0.0016   0.0003  -0.00    5.8
2021/03/18 12:19:06.323   46.848513143   6.490020556   347.1328   1  16   0.0051   0.0037   0.0083 \
  0.0012  -0.0016   0.0003  -0.00    5.7
"""


@pytest.mark.parametrize(("scale", "late_s"), [("GPST", -18.0), ("UTC ", 0.0)])
def test_time_marks_of_rtklib_are_events(tmp_path, scale, late_s):
    """Oracle: rows as RTKLIB writes them, by its header's scale."""
    path = tmp_path / "rover_events.pos"
    path.write_text(POS.format(scale))
    events = read_events(path)
    assert sniff_events(path) == "events_pos"
    assert events.images == ("1", "2")
    np.testing.assert_allclose(events.time, TOW + late_s + np.array([0.623, 2.323]), atol=1e-6)


def test_exif_is_a_last_resort(tmp_path):
    """Oracle: the tags that were written: whole seconds, and nothing that says their scale."""
    for k, name in enumerate(("a.jpg", "b.jpg")):
        photograph(tmp_path / name, 4.0 + 2.0 * k)
    with pytest.raises(InputError, match=r"a.jpg: dates do not say"):
        events_of(tmp_path)
    events = events_of(tmp_path, time_scale="utc", columns=None)
    week, noon = gps_from_calendar(datetime(2018, 10, 4, 12), "utc")
    assert events.gps_week == week
    np.testing.assert_allclose(events.time, noon + np.array([4.5, 6.5]), atol=1e-6)
    np.testing.assert_allclose(events.sigma_s, 12.0**-0.5)
    assert "which have the camera's own clock" in " ".join(check.found for check in events.notes)


def test_an_uncertain_time_is_in_every_covariance():
    """Oracle: 10 m/s and 0.1 rad/s of yaw times 0.29 s, by hand."""
    exposed = Trajectory(
        np.array([1.0]),
        np.array([0.8]),
        np.array([0.1]),
        np.array([500.0]),
        np.array([[10.0, 0.0, 0.0]]),
        np.eye(3)[None],
        1e-6 * np.eye(9)[None],
        2021,
        rate_b=np.array([[0.0, 0.0, 0.1]]),
    )
    cov = at_uncertain_times(exposed, np.array([0.29])).cov[0]
    assert cov[0, 0] == pytest.approx(2.9**2, rel=1e-4)
    assert cov[8, 8] == pytest.approx(0.029**2 + 1e-6)
    assert cov[0, 8] == pytest.approx(2.9 * 0.029)
    assert cov[1, 1] == pytest.approx(1e-6)
