"""Units of what files hold, with their factors to SI and radians.

A unit may carry a number: "0.05 deg/s" is what one count means.

Standard gravity 9.80665 m/s^2 is what g, mg and ug mean, wherever the sensor stands. A time may be
of a clock that counts on from an epoch: `unix` (UTC, 1970-01-01, every day 86400 s) and `gps`
(GPST, 1980-01-06), `unix_ms`, `unix_us` and `unix_ns` in parts of seconds.
"""

import math
import re
from collections.abc import Mapping, Sequence

from ....base.errors import UsageError
from ....base.units import DEG, STANDARD_GRAVITY
from .layout import quote

SENSOR_SCALES: dict[str, dict[str, float]] = {
    "gyro": {"rad/s": 1.0, "deg/s": DEG, "mdeg/s": 1e-3 * DEG, "deg/h": DEG / 3600.0},
    "accel": {
        "m/s^2": 1.0,
        "g": STANDARD_GRAVITY,
        "mg": 1e-3 * STANDARD_GRAVITY,
        "ug": 1e-6 * STANDARD_GRAVITY,
    },
    "gyro increment": {"rad": 1.0, "deg": DEG, "arcsec": DEG / 3600.0},
    "accel increment": {
        "m/s": 1.0,
        "g*s": STANDARD_GRAVITY,
        "mg*s": 1e-3 * STANDARD_GRAVITY,
        "ug*s": 1e-6 * STANDARD_GRAVITY,
    },
    "angle": {"deg": DEG, "rad": 1.0},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "ft": 0.3048},
    "pressure": {"Pa": 1.0, "hPa": 1e2, "mbar": 1e2, "kPa": 1e3},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "kn": 1852.0 / 3600.0},
    "field": {"uT": 1.0, "nT": 1e-3, "mG": 0.1, "G": 100.0},
    "time": {
        **{"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
        **{"unix": 1.0, "unix_ms": 1e-3, "unix_us": 1e-6, "unix_ns": 1e-9, "gps": 1.0},
    },
}
_NUMBER_AND_UNIT = re.compile(
    r"(\d+(?:\.\d*)?(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)?(?:\s*[*])?(.*)",
    re.DOTALL | re.ASCII,
)
_SPELLED_UNITS = {
    "deg/s": "degs-1 degps degpers degpersec deg/sec deg/second degrees/s degrees/sec"
    " degrees/second dps °/s",
    "mdeg/s": "mdps mdegs mdeg/sec m°/s",
    "rad/s": "rads-1 radps radpers radpersec rad/sec rad/second radians/s radians/sec"
    " radians/second",
    "deg/h": "deg/hr deg/hour degph degphr degperh degperhr degh °/h",
    "m/s2": "ms-2 mss ms2 mpers2 m/second2 m/s/s mps2 m/sec2",
    "m/s": "ms-1 mps",
    "km/h": "kmh kph",
    "kn": "knot knots kt kts",
    "deg": "° degree degrees",
    "rad": "radian radians",
    "arcsec": "arcs",
    "ft": "foot feet",
    "m": "meter metre meters metres",
    "s": "sec secs second seconds",
    "ms": "msec millisecond milliseconds",
    "us": "usec µs microsecond microseconds",
    "ns": "nsec nsecs nanosecond nanoseconds",
}
_SPELLINGS = {name: unit for unit, names in _SPELLED_UNITS.items() for name in names.split()}
_RAISED = str.maketrans("⁻¹²", "-12")


def unit_name(unit: str) -> str:
    """Return one spelling for each unit: m/s^2, m/s**2, m/s² and m s^-2 are m/s2."""
    plain = re.sub(r"[\s*^·]", "", unit.lower()).translate(_RAISED)
    return _SPELLINGS.get(plain, plain)


def split_unit(text: str) -> tuple[float, str]:
    """Return the number before a unit (1 without one), and the unit in one spelling."""
    match = _NUMBER_AND_UNIT.fullmatch(text.strip())
    number, unit = match.groups() if match else (None, text)
    return (1.0 if number is None else float(number)), unit_name(unit)


def unit_factor(text: str, kind: str) -> float:
    """Return the factor that takes a value in the unit `text` to SI or radians.

    Parameters
    ----------
    text : str
        The unit, which a number may precede.
    kind : str
        One of the keys of `SENSOR_SCALES`.

    Raises
    ------
    UsageError
        What is no such unit, or a number that is not positive.
    """
    number, unit = split_unit(text)
    factor = next(
        (factor for name, factor in SENSOR_SCALES[kind].items() if unit_name(name) == unit), None
    )
    if factor is None:
        raise UsageError(
            f"{quote(text)} is none of {', '.join(SENSOR_SCALES[kind])}, with or without a "
            "number before it"
            " (the value of one count, such as 0.05 deg/s)"
        )
    if not 0.0 < number * factor < math.inf:
        raise UsageError(f"{quote(text)}: the number before a unit must be positive")
    return number * factor


def is_unit(text: str, kind: str) -> bool:
    """Return whether `text` is a unit of this kind, with or without a number before it."""
    return factor_of(text, (kind,)) is not None


def factor_of(unit: str, kinds: Sequence[str]) -> float | None:
    """Return the factor of a unit of the first of `kinds` that has it, None where none has."""
    for kind in kinds:
        try:
            return unit_factor(unit, kind)
        except UsageError:
            continue
    return None


def usual_unit(text: str, kind: str) -> str:
    """Return the unit `text` as `SENSOR_SCALES` spells it.

    It stays as it stands with a number before it, and where it is none of the kind.
    """
    number, unit = split_unit(text)
    return next(
        (name for name in SENSOR_SCALES[kind] if number == 1.0 and unit_name(name) == unit), text
    )


def imu_kinds(quantity: str) -> tuple[str, str]:
    """Return the kinds of units of the gyro and the accelerometer columns of a quantity."""
    return ("gyro increment", "accel increment") if quantity == "increments" else ("gyro", "accel")


def check_units(units: Mapping[str, str] | None, keys: tuple[str, ...]) -> Mapping[str, str]:
    """Return the caller's units; UsageError for an unknown key."""
    unknown = next((key for key in units or {} if key not in keys), None)
    if unknown is not None:
        raise UsageError(f"units: {unknown!r} is none of {', '.join(keys)}")
    return units or {}
