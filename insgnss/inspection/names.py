"""Names that columns go by, compared without case, blanks and signs, and the unknown table whose columns bear them."""

import re
from dataclasses import dataclass, field
from itertools import product

from ..records import Array


def squashed(name: str) -> str:
    """Name without case, blanks and signs; brackets with a unit are left out."""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"[(\[](?!\d+[)\]])[^)\]]*[)\]]", "", name.lower()))


def spellings(name: str) -> list[str]:
    """Squashed name, and without what stands before its dots (`field.header.stamp` is `stamp` too) or slashes (`/imu/data/gyro/x`)."""
    plain = re.sub(r"[(\[](?!\d+[)\]])[^)\]]*[)\]]", "", name).strip().strip("\"'")
    parts = re.split(r"[./]", plain) if plain.startswith("/") else plain.split(".")
    return [squashed(".".join(parts[k:])) for k in range(len(parts))]


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
_TAILS = (
    "",
    "s",
    "sec",
    "secs",
    "seconds",
    "ms",
    "msec",
    "us",
    "usec",
    "ns",
    "nsec",
    "stamp",
    "stampms",
    "stampus",
    "stampns",
    "stampnsec",
    "stamps",
    "stampsec",
)
_HEADS = ("", "imu", "gyro", "sensor", "sample", "gps", "gnss", "l", "unix", "utc", "system")
CLOCK_NAMES = {f"{head}time{tail}" for head in _HEADS for tail in _TAILS} | {
    *("tow", "gpstow", "gpstows", "sow", "gpssow", "gpst", "seconds", "secs", "sec", "tows", "towms", "itow", "timeofweek", "epoch"),
    *("secofweek", "secondsofweek", "gpsseconds", "gpssec", "stamp", "headerstamp", "elapsed", "secondselapsed", "zeit", "zeits"),
    *("rosbagtimestamp", "headertime", "sampletimefine", "headerstampsec", "headerstampsecs", "stampsec", "stampsecs", "utc", "gps"),
    *("t", "ts", "tms", "tus", "tns", "ms", "us", "millis", "micros"),
}
WEEK_NAMES = {"week", "gpsweek", "wn", "gwk", "wk"}
GNSS_NAMES: dict[str, tuple[str, ...]] = {
    "lat": ("lat", "latitude", "latdeg", "latituded", "latitudedeg", "phideg", "latrad", "gpslat", "breite", "breitengrad"),
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
    "vd": ("vd", "veld", "vdown", "veldown", "downvelocity", "velocitydown", "vdms", "vz", "veldms"),
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
GNSS_NAMES |= {
    "sd_ne": ("hacc", "hacch", "haccm", "eph", "ephm", "horizontalaccuracy", "haccuracy", "accuracyhorizontal"),
    "sd_u": (*GNSS_NAMES["sd_u"], "vacc", "vaccm", "epv", "epvm", "verticalaccuracy", "vaccuracy", "accuracyvertical"),
    "var_e": ("positioncovariance0",),  # of ROS, along east, north and up
    "var_n": ("positioncovariance4",),
    "var_u": ("positioncovariance8",),
}


@dataclass(frozen=True, eq=False)
class Grid:
    """An unknown table: values (n, m), the name of each column or None, and the unit its header gives, or None.

    nanos : of a clock in two columns, that of the seconds and that of the nanoseconds; the values of the former are those of both.
    """

    values: Array
    names: tuple[str | None, ...]
    units: tuple[str | None, ...] = ()
    nanos: dict[int, int] = field(default_factory=dict)

    @property
    def named(self) -> dict[str, int]:
        """Index by squashed name; the first of equal names."""
        found: dict[str, int] = {}
        for k, name in enumerate(self.names):
            if name is not None:
                found.setdefault(squashed(name), k)
        for k, name in enumerate(self.names):
            for short in spellings(name)[1:] if name is not None else ():
                found.setdefault(short, k)
        for name, k in list(found.items()):  # a unit written behind the name without brackets
            if tail := UNIT_TAIL.fullmatch(name):
                found.setdefault(tail[1], k)
        return found
