"""Names that columns go by, compared without case, blanks and signs, and the unknown table."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product

from ....io.formats import UNITS
from ....io.formats.text.headers import LONGEST_NAME, factor_of, unit_in, without_unit
from ....io.formats.text.units import usual_unit
from ....records import Array

# kinds of the units of what is no clock
OF_VALUES = tuple(kind for kind in UNITS if kind != "time")


def squashed(name: str) -> str:
    """Return a name without case, blanks and signs; brackets with a unit are left out."""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"[(\[](?!\d+[)\]])[^)\]]*[)\]]", "", name.lower()))


def spellings(name: str) -> list[str]:
    """Return the squashed name, also without the parts before its dots or slashes.

    So `field.header.stamp` is `stamp` too, and `/imu/data/gyro/x` is `x`.
    """
    return [squashed(suffix) for suffix in _parts(name)]


def bare(name: str, kinds: Sequence[str]) -> list[str]:
    """Return the spellings of a name without a unit of one of `kinds`, where it has one."""
    return [squashed(stem) for suffix in _parts(name) for stem, _ in without_unit(suffix, kinds)]


def _parts(name: str) -> list[str]:
    """Name without brackets, and what follows each of its dots or slashes; of none an empty one."""
    name = name if len(name) <= LONGEST_NAME else ""
    plain = re.sub(r"[(\[](?!\d+[)\]])[^)\]]*[)\]]", "", name).strip().strip("\"'")
    parts = re.split(r"[./]", plain) if plain.startswith("/") else plain.split(".")
    return [".".join(parts[k:]) for k in range(len(parts))]


def _triad_names(*stems: str) -> list[tuple[str, ...]]:
    """Names of the x, y and z component of a triad with these stems, in the usual spellings."""
    places = [("x", "y", "z"), ("1", "2", "3"), ("0", "1", "2")]
    return [
        tuple(f"{stem}{letter}" for letter in letters) for stem, letters in product(stems, places)
    ] + [tuple(f"{letter}{stem}" for letter in "xyz") for stem in stems if len(stem) > 2]


GYRO_NAMES = [
    ("p", "q", "r"),
    ("rollrate", "pitchrate", "yawrate"),
    *_triad_names(
        "g",
        "gyr",
        "gyro",
        "gyroscope",
        "w",
        "wb",
        "wrss",
        "omega",
        "rate",
        "angrate",
        "angularrate",
        "angularvelocity",
    ),
    *_triad_names(
        "gyrorad", "rotationrate", "dtheta", "dang", "deltaangle", "delang", "imugyro", "imug"
    ),
]
ACCEL_NAMES = _triad_names(
    *(
        "a",
        "arss",
        "acc",
        "accel",
        "accelerometer",
        "acceleration",
        "linearacceleration",
        "linacc",
        "accelerometerms2",
        "f",
        "fb",
    ),
    *("specificforce", "dv", "dvel", "deltavelocity", "delvel", "imuaccel", "imuacc", "imua"),
)
_HEADS = ("", "imu", "gyro", "sensor", "sample", "gps", "gnss", "l", "unix", "utc", "system")
CLOCK_NAMES = {f"{head}time{tail}" for head in _HEADS for tail in ("", "s", "stamp", "stamps")} | {
    *(
        "tow",
        "gpstow",
        "sow",
        "gpssow",
        "gpst",
        "seconds",
        "secs",
        "sec",
        "itow",
        "timeofweek",
        "epoch",
    ),
    *(
        "secofweek",
        "secondsofweek",
        "gpsseconds",
        "gpssec",
        "stamp",
        "headerstamp",
        "elapsed",
        "secondselapsed",
        "zeit",
    ),
    *("rosbagtimestamp", "headertime", "sampletimefine", "utc", "gps"),
    *("t", "ts", "ms", "us", "millis", "micros"),
}
WEEK_NAMES = {"week", "gpsweek", "wn", "gwk", "wk"}
GNSS_NAMES: dict[str, tuple[str, ...]] = {
    "lat": (
        "lat",
        "latitude",
        "latdeg",
        "latituded",
        "latitudedeg",
        "phideg",
        "latrad",
        "gpslat",
        "breite",
        "breitengrad",
    ),
    "lon": (
        "lon",
        "lng",
        "long",
        "longitude",
        "londeg",
        "lngdeg",
        "longitudedeg",
        "lonrad",
        "gpslon",
        "gpslng",
        "laenge",
        "lnge",
        "laengengrad",
        "lngengrad",
    ),
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
        "hoehe",
        "hhe",
        "h",
    ),
    "vn": ("vn", "veln", "vnorth", "velnorth", "northvelocity", "velocitynorth", "vnms", "velnms"),
    "ve": ("ve", "vele", "veast", "veleast", "eastvelocity", "velocityeast", "vems", "velems"),
    "vd": (
        "vd",
        "veld",
        "vdown",
        "veldown",
        "downvelocity",
        "velocitydown",
        "vdms",
        "vz",
        "veldms",
    ),
    "vu": ("vu", "velu", "vup", "velup", "upvelocity", "velocityup"),
    "speed": ("spd", "speed", "gndspd", "groundspeed", "gspd", "hspeed"),
    "q": (
        *("q", "quality", "fixquality", "gpsquality", "qualityindicator", "fix", "fixstatus"),
        *("fixtype", "gpsfix", "fixmode", "solution", "solutionstatus", "rtkstatus", "posmode"),
        *("gpsstatus", "status"),
    ),
    "course": ("gcrs", "course", "coursedeg", "cog", "groundcourse", "gcourse", "track"),
}
GNSS_NAMES |= {
    f"sd_{axis}": tuple(
        f"{head}{name}" for head, name in product(("sd", "std", "sigma", "acc", "rms"), names)
    )
    for axis, names in (
        ("n", ("n", "north", "lat")),
        ("e", ("e", "east", "lon")),
        ("u", ("u", "up", "d", "h", "alt", "height")),
        *((axis, (axis,)) for axis in ("vn", "ve")),
        ("vd", ("vd", "vu")),
    )
}
GNSS_NAMES |= {
    "sd_ne": (
        "hacc",
        "hacch",
        "haccm",
        "eph",
        "ephm",
        "horizontalaccuracy",
        "haccuracy",
        "accuracyhorizontal",
    ),
    "sd_u": (
        *GNSS_NAMES["sd_u"],
        "vacc",
        "vaccm",
        "epv",
        "epvm",
        "verticalaccuracy",
        "vaccuracy",
        "accuracyvertical",
    ),
    "var_e": ("positioncovariance0",),  # of ROS, along east, north and up
    "var_n": ("positioncovariance4",),
    "var_u": ("positioncovariance8",),
}


@dataclass(frozen=True)
class Roles:
    """Columns by canonical name, the clocks that may stamp them, units, and the reason.

    A clock is a column and its unit. `left` gives, for columns of known names that are left out,
    the name and the reason.
    """

    columns: dict[str, int]
    clocks: dict[int, str] = field(default_factory=dict)
    week: int | None = None
    units: dict[str, str] = field(default_factory=dict)
    repeat_column: int | None = None
    how: str = "by the names of its columns"
    left: dict[int, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Grid:
    """An unknown table: values (n, m) and the name of each column, or None.

    `nanos` maps, for a clock in two columns, that of the seconds to that of the nanoseconds; the
    values of the former are those of both.
    """

    values: Array
    names: tuple[str | None, ...]
    nanos: dict[int, int] = field(default_factory=dict)

    @property
    def named(self) -> dict[str, int]:
        """Index by squashed name; the first of equal names."""
        columns: dict[str, int] = {}
        for k, name in enumerate(self.names):
            if name is not None:
                columns.setdefault(squashed(name), k)
        for k, name in enumerate(self.names):
            for short in spellings(name)[1:] if name is not None else ():
                columns.setdefault(short, k)
        for k, name in enumerate(self.names):
            for short in bare(name, OF_VALUES) if name is not None else ():
                columns.setdefault(short, k)
        return columns

    def unit_of(self, column: int, kind: str) -> str | None:
        """Return the unit of a kind that the name of a column gives, as the readers take it.

        The unit is in brackets or behind the name; None without one.
        """
        name = self.names[column]
        unit = None if name is None else unit_in(name, (kind,))
        return None if unit is None or factor_of(unit, (kind,)) is None else usual_unit(unit, kind)
