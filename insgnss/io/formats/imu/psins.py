"""IMU log of the PSINS toolbox (lasergyro.imu), data_specs/psins.md.

    line 1   pitch roll yaw deg, velocity east north up m/s
             first guess of the attitude, yaw positive to the west
    line 2   latitude longitude deg, height m, t0 s, ts ms, g m/s^2
    line 3   value of one count: gyro x y z arcsec, accelerometer x y z ug s
    then     gyro x y z, accelerometer x y z, counts: increments over the interval of ts that ends
             at the sample

Sample k (from 1) is stamped t0 + k ts. One g is the g of line 2, with which the counts of specific
force were made; axes as the header says, mostly x right, y forward, z up, and left so. A yaw that
is positive to the west is heading = -yaw.
"""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....records import ImuSamples
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.clock import gps_time
from ..text.layout import BINARY, TextLayout, decode, is_binary, is_comment
from ..text.order import refuse_rows
from ..text.text import TRUNCATED, FileLine, Source, load, parse
from ..text.units import DEG

HEAD_LINES, LINE_VALUES = 3, 6  # lines of the header, and values of a line: as PSINS writes them
PSINS_AXES = "right forward up"
# counts of an increment: a larger one is no reading of a sensor (chosen)
LARGEST_INCREMENT_COUNTS = 1e9


@dataclass(frozen=True)
class PsinsHeader:
    """The header of a log.

    Attributes
    ----------
    rpy, velocity_ned : tuple
        Roll, pitch, heading rad and velocity north, east, down m/s, first guesses.
    lat, lon, height : float
        rad and m.
    t0, interval_s : float
        s.
    gravity : float
        m/s^2.
    gyro_lsb, accel_lsb : tuple
        (3,) value of a count, rad and m/s.
    axes : str
        Body directions of x, y, z.
    """

    rpy: tuple[float, ...]
    velocity_ned: tuple[float, ...]
    lat: float
    lon: float
    height: float
    t0: float
    interval_s: float
    gravity: float
    gyro_lsb: tuple[float, ...]
    accel_lsb: tuple[float, ...]
    axes: str


def read_psins_header(path: Source) -> PsinsHeader:
    """Read where the recording was made and how its counts are scaled.

    Raises
    ------
    InputError
        What cannot be read, with file and line.
    """
    buf, _ = load(path)
    return _header(path, buf)[0]


def read_psins(path: Source, options: ReadOptions = STATED_NOTHING) -> ImuSamples:
    """Read increments into rad and m/s, or mean rates where `quantity` is "mean_rate".

    The axes stay those of the file.
    """
    quantity = options.quantity or "increments"
    buf, complete = load(path)
    header, offset, line = _header(path, buf)
    layout = TextLayout(None, ".", LINE_VALUES, skip_to=offset, first_line=line)
    table = parse(path, buf, complete, layout)
    if not len(table.values):
        raise InputError.in_file(path, "ends behind its header; copy it again")
    if not complete:
        raise table.error_at(len(table.values) - 1, TRUNCATED)
    beyond = np.abs(table.values).max(axis=1, initial=0.0) > LARGEST_INCREMENT_COUNTS
    refuse_rows(
        table, beyond, f"a count exceeds {LARGEST_INCREMENT_COUNTS:g}; correct or delete the line"
    )
    time = header.t0 + header.interval_s * np.arange(1.0, len(table.values) + 1.0)
    time, gps_week = gps_time(table, time, None, options.gps_week)
    increments = table.values * [*header.gyro_lsb, *header.accel_lsb]
    if quantity != "increments":
        increments = increments / header.interval_s
    return ImuSamples(time, increments[:, :3], increments[:, 3:], quantity, gps_week, str(path))


def _header(path: Source, buf: NDArray[np.uint8]) -> tuple[PsinsHeader, int, int]:
    """Return the header, the offset of the first sample and its line."""
    rows: list[tuple[FileLine, list[float]]] = []
    offset, axes = 0, ""
    data = buf.tobytes()
    count = 0  # of lines
    while len(rows) < HEAD_LINES and offset < len(data):
        count += 1
        line = FileLine(path, count)
        end = data.index(b"\n", offset)
        text = decode(data[offset:end])
        offset = end + 1
        if is_comment(text):
            axes = axes or _axes(text)
        elif text.strip():
            if is_binary(text):
                raise line.error(f"is no text; {BINARY}")
            fields = [line.value(field) for field in text.split()]
            if len(fields) != LINE_VALUES:
                problem = f"{len(fields)} values in the header's line {len(rows) + 1}"
                raise line.error(f"{problem}, expected {LINE_VALUES}; is it a PSINS log?")
            rows.append((line, fields))
    if len(rows) < HEAD_LINES:
        raise InputError.in_file(
            path, f"ends within its header, {len(rows)} of {HEAD_LINES} lines; copy it again"
        )
    (_, first), (site_line, site), (scale_line, scale) = rows
    if (
        abs(site[0]) > 90.0
        or abs(site[1]) > 360.0
        or not 0.0 < site[4] <= 1e4
        or not 9.0 < site[5] < 10.0
        or not 0.0 <= site[3] < 1e6
    ):
        expected = "latitude, longitude, height, t0, interval (ms) and g"
        raise site_line.error(f"this line must hold {expected}; is it a PSINS log?")
    if not all(0.0 < abs(value) < 1e9 for value in scale):
        expected = "the values of one count (arcsec, ug s)"
        raise scale_line.error(f"this line must hold {expected}; is it a PSINS log?")
    rpy = (first[1] * DEG, first[0] * DEG, -first[2] * DEG)
    velocity = (first[4], first[3], -first[5])
    site_values = (site[0] * DEG, site[1] * DEG, site[2], site[3], 1e-3 * site[4], site[5])
    gyro = tuple(DEG / 3600.0 * value for value in scale[:3])
    accel = tuple(1e-6 * site[5] * value for value in scale[3:])
    header = PsinsHeader(rpy, velocity, *site_values, gyro, accel, axes or PSINS_AXES)
    return header, offset, count + 1


def _axes(text: str) -> str:
    """Return the body directions that a comment names: `X-Right,Y-Foward,Z-Up`."""
    match = re.search(r"X-(\w+),\s*Y-(\w+),\s*Z-(\w+)", text)
    return " ".join(match.groups()).lower().replace("foward", "forward") if match else ""
