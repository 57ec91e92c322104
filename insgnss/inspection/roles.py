"""Which column of an unknown table is what: by its name where it has one, else by what its values do.

A name decides where there is one (`IMU_NAMES`, `GNSS_NAMES`, compared without case, blanks and signs). Values decide only for
`insgnss inspect`, which says what it found and why; the readers never guess. By values

    a clock      increases from row to row in nearly equal steps
    a GPS week   is a whole number of 500 to 4000, the same in all rows or one more after a while
    a triad      is three neighbouring columns; that of the accelerometer holds gravity, so its mean is large against its scatter,
                 the gyro's is small: the ratio |mean| / scatter tells the two apart at rest and in flight
    a position   is a latitude and a longitude beside each other that move no faster than an aircraft, the height behind them
    a velocity   is the triad whose values are the differences of the positions (correlation and slope near one), which also
                 tells its order: north east down, north east up or east north up
    sigmas       are triads of small positive numbers behind position and velocity, in the order of that velocity
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from ..geodesy.earth import curvature_radii
from ..records import Array

GYRO, ACCEL = ("gx", "gy", "gz"), ("ax", "ay", "az")
ANGLES = {"deg": float(np.pi / 180.0), "rad": 1.0}
TIME_FACTORS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
MOST_QUALITY = 7  # of RTKLIB's codes
FASTEST_MS, LARGEST_SIGMA = 150.0, 100.0
FOLLOWS, SLOPE = 0.8, (0.75, 1.3)  # correlation and slope of a velocity against the differences of the positions
EVEN_SHARE = 0.6  # of the steps of an unnamed clock near the usual one: receivers leave fixes out
APART = 4.0  # times that the ratio of the accelerometer exceeds that of the gyro


def squashed(name: str) -> str:
    """Name without case, blanks and signs; brackets with a unit are left out."""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"[(\[]\D[^)\]]*[)\]]", "", name.lower()))


def _triad_names(*stems: str) -> list[tuple[str, ...]]:
    """Names of the x, y and z component of a triad with these stems, in each of the usual spellings."""
    places = [("x", "y", "z"), ("1", "2", "3"), ("0", "1", "2")]
    return [tuple(f"{stem}{letter}" for letter in letters) for stem, letters in product(stems, places)] + [
        tuple(f"{letter}{stem}" for letter in "xyz") for stem in stems if len(stem) > 2
    ]


GYRO_NAMES = [
    ("p", "q", "r"),
    ("rollrate", "pitchrate", "yawrate"),
    *_triad_names("g", "gyr", "gyro", "gyroscope", "w", "wb", "wrss", "omega", "rate", "angrate", "angularrate", "angularvelocity"),
    *_triad_names("gyrorad", "rotationrate", "dtheta", "dang", "deltaangle", "delang", "imugyro", "imug"),
]
ACCEL_NAMES = _triad_names(
    *("a", "arss", "acc", "accel", "accelerometer", "acceleration", "linearacceleration", "linacc", "accelerometerms2", "f", "fb"),
    *("specificforce", "dv", "dvel", "deltavelocity", "delvel", "imuaccel", "imuacc", "imua"),
)
UNIT_TAIL = re.compile(r"(.*[xyz1-3])(rads|radps|rps|rad|degs|degps|deg|dps|degh|degph|ms2|mss|mps2|mg|g)")
_TAILS = ("", "s", "sec", "secs", "seconds", "ms", "msec", "us", "usec", "ns", "nsec", "stamp", "stampms", "stampus", "stamps", "stampsec")
_HEADS = ("", "imu", "gyro", "sensor", "sample", "gps", "gnss", "l", "unix", "utc", "system")
CLOCK_NAMES = {f"{head}time{tail}" for head in _HEADS for tail in _TAILS} | {
    *("tow", "gpstow", "gpstows", "sow", "gpssow", "gpst", "seconds", "secs", "sec", "tows", "towms", "itow", "timeofweek", "epoch"),
    *("secofweek", "secondsofweek", "gpsseconds", "gpssec", "stamp", "headerstamp", "elapsed", "secondselapsed"),
    *("t", "ts", "tms", "tus", "tns", "ms", "us", "millis", "micros"),
}
WEEK_NAMES = {"week", "gpsweek", "wn", "gwk", "wk"}
GNSS_NAMES: dict[str, tuple[str, ...]] = {
    "lat": ("lat", "latitude", "latdeg", "latituded", "latitudedeg", "phideg", "latrad", "gpslat"),
    "lon": ("lon", "lng", "long", "longitude", "londeg", "lngdeg", "longitudedeg", "lonrad", "gpslon", "gpslng"),
    "h": (
        "hell",
        "ellheight",
        "altellipsoid",
        "ellipsoidheight",
        "ellipsoidalheight",
        "heightellipsoid",
        "alt",
        "altitude",
        "altm",
        "altitudem",
        "gpsalt",
        "hgt",
        "height",
        "heightm",
        "hm",
        "altmsl",
        "heightmsl",
        "elevation",
        "ele",
        "h",
    ),
    "vn": ("vn", "veln", "vnorth", "velnorth", "northvelocity", "velocitynorth", "vnms"),
    "ve": ("ve", "vele", "veast", "veleast", "eastvelocity", "velocityeast", "vems"),
    "vd": ("vd", "veld", "vdown", "veldown", "downvelocity", "velocitydown", "vdms", "vz"),
    "vu": ("vu", "velu", "vup", "velup", "upvelocity", "velocityup"),
    "speed": ("spd", "speed", "gndspd", "groundspeed", "gspd", "hspeed"),
    "q": ("q", "quality", "fixquality"),
    "course": ("gcrs", "course", "coursedeg", "cog", "groundcourse", "gcourse", "track"),
}
GNSS_NAMES |= {
    f"sd_{axis}": tuple(f"{head}{name}" for head, name in product(("sd", "std", "sigma", "acc", "rms"), names))
    for axis, names in (
        ("n", ("n", "north", "lat")),
        ("e", ("e", "east", "lon")),
        ("u", ("u", "up", "d", "h", "alt", "height")),
        *((axis, (axis,)) for axis in ("vn", "ve")),
        ("vd", ("vd", "vu")),
    )
}


@dataclass(frozen=True, eq=False)
class Grid:
    """An unknown table: values (n, m), the name of each column or None, and the unit its header gives, or None."""

    values: Array
    names: tuple[str | None, ...]
    units: tuple[str | None, ...] = ()

    @property
    def named(self) -> dict[str, int]:
        """Index by squashed name; the first of equal names."""
        found: dict[str, int] = {}
        for k, name in enumerate(self.names):
            if name is not None:
                found.setdefault(squashed(name), k)
        for name, k in list(found.items()):  # a unit written behind the name without brackets
            if tail := UNIT_TAIL.fullmatch(name):
                found.setdefault(tail[1], k)
        return found


@dataclass(frozen=True)
class Roles:
    """Columns by canonical name, the clocks that may stamp them (column and factor to seconds), units, and why."""

    columns: dict[str, int]
    clocks: dict[int, str] = field(default_factory=dict)
    week: int | None = None
    units: dict[str, str] = field(default_factory=dict)
    new_when: int | None = None
    how: str = "by the names of its columns"


def imu_roles(grid: Grid) -> Roles | None:
    """Gyro and accelerometer of a table, or None where it has none."""
    names = grid.named
    found: dict[str, int] = {}
    for canonical, known in ((GYRO, GYRO_NAMES), (ACCEL, ACCEL_NAMES)):
        triad = next((names_ for names_ in known if all(name in names for name in names_)), None)
        if triad is not None:
            found |= {c: names[name] for c, name in zip(canonical, triad, strict=True)}
    if len(found) == 6:
        return Roles(found, clocks(grid, 0.5), _week(grid))
    if any(name is not None for name in grid.names):
        return None
    ticks = clocks(grid, 0.5)
    pair = _two_triads(grid.values, {*ticks, *_weeks(grid)})
    if pair is None:
        return None
    gyro, accel = pair
    columns = {c: first + k for first, triad in ((gyro, GYRO), (accel, ACCEL)) for k, c in enumerate(triad)}
    return Roles(columns, ticks, _week(grid), how="by their values: gravity is in one triad, not in the other")


def _two_triads(values: Array, taken: set[int]) -> tuple[int, int] | None:
    """First column of the gyro's and of the accelerometer's triad among the columns that change, or None."""
    rows = values[:: max(1, len(values) // 20000)]
    alive = [k not in taken and float(np.ptp(rows[:, k])) > 0.0 for k in range(values.shape[1])]
    best: tuple[float, int, int] | None = None
    for first in range(values.shape[1] - 5):
        if not all(alive[first : first + 6]):
            continue
        ratio = [_steadiness(rows[:, k : k + 3]) for k in (first, first + 3)]
        gap = max(ratio) / max(min(ratio), 1e-12)
        if gap > APART and max(ratio) > 0.8 and (best is None or first == 0 or not alive[first - 1]):
            order = (first + 3, first) if ratio[0] > ratio[1] else (first, first + 3)
            best = best or (gap, *order)
    return None if best is None else best[1:]


def _steadiness(triad: Array) -> float:
    """|mean| / scatter."""
    return float(np.linalg.norm(np.mean(triad, axis=0)) / max(np.sqrt(np.sum(np.var(triad, axis=0))), 1e-30))


def clocks(grid: Grid, longest_step: float) -> dict[int, str]:
    """Columns that are clocks and their units; a name tells the candidates where there are names, the step the unit.

    longest_step : s, of the sensor; 0.5 for an IMU, 30 for GNSS.
    """
    named = any(name is not None for name in grid.names)
    found: dict[int, str] = {}
    for k, name in enumerate(grid.names):
        if named and (name is None or squashed(name) not in CLOCK_NAMES):
            continue
        unit = _clock_unit(grid.values[:, k], longest_step, strict=not named)
        if unit is not None:
            found[k] = unit
    return dict(sorted(found.items(), key=lambda item: item[1] != "s"))  # seconds before parts of seconds


def _clock_unit(column: Array, longest_step: float, strict: bool) -> str | None:
    step = np.diff(column)
    forward = step[step > 0.0]
    if forward.size < (0.5 if longest_step < 1.0 else 0.001) * step.size or forward.size < 5 or (step < 0.0).mean() > 0.01:
        return None
    typical = float(np.median(forward))
    if strict and (forward.size < 0.99 * step.size or np.mean(np.abs(forward - typical) < 0.5 * typical) < EVEN_SHARE):
        return None
    span = float(column[-1] - column[0])
    if strict and span < 0.5 * typical * step.size:
        return None
    return next((unit for unit, factor in TIME_FACTORS.items() if typical * factor <= longest_step), None)


def _weeks(grid: Grid) -> list[int]:
    out = []
    for k, name in enumerate(grid.names):
        column = grid.values[:, k]
        if name is not None and squashed(name) not in WEEK_NAMES:
            continue
        if column.min() >= 500 and column.max() <= 4000 and np.ptp(column) <= 2 and (column == np.round(column)).all():
            out.append(k)
    return out


def _week(grid: Grid) -> int | None:
    return next(iter(_weeks(grid)), None)


def gnss_roles(grid: Grid) -> Roles | None:
    """Positions and what else a receiver says, or None where the table has no positions."""
    names = grid.named
    found = {role: names[name] for role, known in GNSS_NAMES.items() for name in reversed(known) if name in names}
    if {"lat", "lon", "h"} <= found.keys():
        return _completed(grid, found)
    return None if any(name is not None for name in grid.names) else _gnss_by_values(grid)


def _completed(grid: Grid, found: dict[str, int]) -> Roles:
    """Named columns with their units, and what marks a new fix where the last one is held."""
    up = {"vd", "vu"} & found.keys()
    if {"vn", "ve"} <= found.keys() and up:
        unused = {"speed", "course"}
    elif {"speed", "course"} <= found.keys():
        unused = {"vn", "ve", "sd_vn", "sd_ve", "sd_vd"}
    else:
        unused = {"vn", "ve", "vd", "vu", "speed", "course", "sd_vn", "sd_ve", "sd_vd"}
    found = {role: k for role, k in found.items() if role not in unused}
    if "q" in found and not np.isin(grid.values[:, found["q"]], range(MOST_QUALITY + 1)).all():
        del found["q"]
    units = {"angle": _angle_unit(grid, found["lat"], found["lon"])}
    if "course" in found:
        units["course"] = "rad" if np.abs(grid.values[:, found["course"]]).max() <= 6.3 else "deg"
    lat, lon = grid.values[:, found["lat"]], grid.values[:, found["lon"]]
    held = (np.diff(lat) == 0.0) & (np.diff(lon) == 0.0)
    ticks = clocks(grid, 30.0)
    new_when = None
    if held.size and held.mean() > 0.5:
        changes = ~held
        marks = [k for k in ticks if np.mean((np.diff(grid.values[:, k]) != 0.0) == changes) > 0.95]
        new_when = marks[0] if marks else found["lat"]
        ticks = {k: unit for k, unit in ticks.items() if k != new_when}
    return Roles(found, ticks, _week(grid), units, new_when)


def _angle_unit(grid: Grid, lat: int, lon: int) -> str:
    """By the header, else by the values: radians where no value could be none."""
    said = grid.units[lat] if grid.units else None
    if said in ANGLES:
        return str(said)
    small = np.abs(grid.values[:, lat]).max() <= 0.5 * np.pi and np.abs(grid.values[:, lon]).max() <= np.pi
    return "rad" if small else "deg"


def _gnss_by_values(grid: Grid) -> Roles | None:
    ticks = clocks(grid, 30.0)
    taken = {*ticks, *_weeks(grid)}
    if not ticks:
        return None
    clock, unit = next(iter(ticks.items()))
    time = grid.values[:, clock] * TIME_FACTORS[unit]
    orders = [(k, k + 1, k + 2) for k in range(grid.values.shape[1] - 2)] + [(k + 1, k, k + 2) for k in range(grid.values.shape[1] - 2)]
    for lat, lon, height in orders:  # latitude first, unless that is no latitude
        if taken & {lat, lon, height}:
            continue
        place = {"lat": lat, "lon": lon, "h": height}
        angle = _angle_unit(grid, lat, lon)
        metres = _metres(grid, place, ANGLES[angle])
        if metres is None or not _travels(time, metres):
            continue
        more = _velocity_and_sigmas(grid.values, time, metres, height + 1)
        return Roles(
            place | more, ticks, _week(grid), {"angle": angle}, how="by their values: a place on Earth that moves as its velocity says"
        )
    return None


def _metres(grid: Grid, place: dict[str, int], factor: float) -> Array | None:
    """North, east, down (n, 3), m, of the first row; None where the columns are no place on Earth."""
    lat, lon, h = (grid.values[:, place[name]] for name in ("lat", "lon", "h"))
    lat, lon = lat * factor, lon * factor
    if np.abs(lat).max() > 0.5 * np.pi or np.abs(lon).max() > 2.0 * np.pi or h.min() < -1000.0 or h.max() > 10000.0:
        return None
    M, N = curvature_radii(lat[0])
    return np.column_stack([(lat - lat[0]) * M, (lon - lon[0]) * N * np.cos(lat[0]), h[0] - h])


def _travels(time: Array, metres: Array) -> bool:
    """Whether the position changes, and never at more than the speed of an aircraft but for a few rows."""
    step = np.maximum(np.diff(time), 1e-3)
    speed = np.linalg.norm(np.diff(metres[:, :2], axis=0), axis=1) / step
    whole = (metres == np.round(metres)).all()
    return bool(np.mean(speed < FASTEST_MS) > 0.98 and np.ptp(metres[:, 0]) > 0.0 and np.ptp(metres[:, 1]) > 0.0 and not whole)


_ORDERS = {("vn", "ve", "vd"): (0, 1, 2, 1.0), ("vn", "ve", "vu"): (0, 1, 2, -1.0), ("ve", "vn", "vu"): (1, 0, 2, -1.0)}


def _velocity_and_sigmas(values: Array, time: Array, metres: Array, first: int) -> dict[str, int]:
    """Columns of velocity and of standard deviations behind the position, as far as they show themselves."""
    step = np.maximum(np.diff(time), 1e-3)
    seen = np.diff(metres, axis=0) / step[:, None]
    usable = (np.linalg.norm(seen, axis=1) < FASTEST_MS) & (step < 5.0 * np.median(step))
    for k in range(first, values.shape[1] - 2):
        for names, (a, b, c, sign) in _ORDERS.items():
            said = 0.5 * (values[1:, k : k + 3] + values[:-1, k : k + 3])[usable]
            pairs = [(said[:, 0], seen[usable, a]), (said[:, 1], seen[usable, b])]
            if not all(_follows(x, y) for x, y in pairs):
                continue
            vertical = seen[usable, c] * sign
            if np.ptp(said[:, 2]) > 0.0 and np.dot(said[:, 2], vertical) < 0.0:
                continue
            found = dict(zip(names, range(k, k + 3), strict=True))
            axes = [name[1:] if name != "vd" else "u" for name in names]
            of_place, of_speed = (k + 3, k + 6) if k < first + 3 else (first, k + 3)
            speeds = [f"v{axis if axis != 'u' else 'd'}" for axis in axes]
            return found | _sigmas(values, axes, "sd_", of_place) | _sigmas(values, speeds, "sd_", of_speed)
    return _sigmas(values, ("n", "e", "u"), "sd_", first)


def _sigmas(values: Array, axes: Sequence[str], head: str, at: int) -> dict[str, int]:
    """Three columns of standard deviations from `at` on, where they can be such."""
    if at + 3 > values.shape[1] or values[:, at : at + 3].min() <= 0.0 or values[:, at : at + 3].max() > LARGEST_SIGMA:
        return {}
    return {f"{head}{axis}": at + i for i, axis in enumerate(axes)}


def _follows(said: Array, seen: Array) -> bool:
    """Whether two series are the same but for noise."""
    if said.size < 20 or np.std(said) == 0.0 or np.std(seen) == 0.0:
        return False
    slope = float(np.dot(said, seen) / np.dot(said, said))
    return bool(np.corrcoef(said, seen)[0, 1] > FOLLOWS and SLOPE[0] < slope < SLOPE[1])
