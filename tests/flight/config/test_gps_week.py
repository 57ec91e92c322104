"""Weeks of the flight file that cannot be the flight's."""

from datetime import UTC, datetime

import pytest

from insgnss.base.errors import InputError, UsageError
from insgnss.flight.config.flight_file import refuse_week
from insgnss.flight.config.load import load_flight
from insgnss.geodesy.gpstime import gps_from_calendar


def test_a_week_modulo_1024_is_refused_with_the_weeks_that_it_may_be():
    """Oracle: GPS week 2221 began on Sunday 2022-07-31, 1197 on 2002-12-15 (calendar)."""
    with pytest.raises(UsageError, match=r"gps_week = 173: is a week modulo 1024.*2022-07-31"):
        refuse_week(173)
    with pytest.raises(UsageError, match=r"2002-12-15"):
        refuse_week(173)


def test_a_week_to_come_is_refused_and_the_present_one_is_not():
    """Oracle: the clock; the next week is left to clocks of the wrong day."""
    now, _ = gps_from_calendar(datetime.now(UTC))
    with pytest.raises(UsageError, match="in the future"):
        refuse_week(now + 2)
    for week in (None, 1024, 2008, now, now + 1):
        refuse_week(week)


@pytest.mark.parametrize("week", [0, 1023])
def test_every_week_below_the_rollover_is_refused_in_a_flight_file(week, tmp_path):
    """Oracle: GPS weeks 1024 and 2047 began on 1999-08-22 and 2019-03-31 (calendar)."""
    path = tmp_path / "flight.toml"
    (tmp_path / "imu.csv").write_text("1\n")
    files = 'imu = { file = "imu.csv" }\ngnss = { file = "imu.csv" }\n'
    path.write_text(f"gps_week = {week}\n{files}")
    dates = "1999-08-22 or 2019-04-07" if week == 0 else "2019-03-31 or 2038-11-14"
    refusal = f"flight.toml:1: gps_week = {week}: .* to {week} .{dates}"
    with pytest.raises(InputError, match=refusal):
        load_flight(path)
