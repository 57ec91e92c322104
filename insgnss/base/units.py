"""Quantities with units in text: "10.825 deg/h/sqrt(Hz)" to SI.

    quantity = number unit            unit   = factor { ("*" | "/") factor }
    factor   = base [ "^" exponent ]  base   = name | "1" | "sqrt(" unit ")" | "(" unit ")"

Dimensions are tracked over angle, length and time with exact rational exponents. Angle is a
dimension, so that a gyroscope's unit is never taken for an accelerometer's; Hz is 1/s, so that
deg/h/sqrt(Hz) and deg/sqrt(h) are of one dimension. There are no prefixes beyond the names of
`UNITS`; ppt is parts per thousand; g is the standard 9.80665 m/s^2. Clocks have a `time_zone`.
"""

import math
import re
import sys
from dataclasses import dataclass
from datetime import timedelta, timezone, tzinfo
from fractions import Fraction
from numbers import Real
from typing import Any
from zoneinfo import ZoneInfo

from .errors import InputError, UsageError, near

STANDARD_GRAVITY = 9.80665  # unit g (m/s^2): CGPM 1901
DEG_PER_H, MILLI_G = math.radians(1.0) / 3600.0, 1e-3 * STANDARD_GRAVITY  # rad/s, m/s^2
FOOT_M = 0.3048  # international foot (m): exact since 1959
# of a quantity whose square is a float, too; more, and less, than any has
SMALLEST_UNIT, LARGEST_UNIT = 1e-150, 1e150
US_FOOT_M = 1200.0 / 3937.0  # foot of the US survey (m): by definition

_NAMES = ("angle", "length", "time")


@dataclass(frozen=True)
class Unit:
    """Scale to SI (rad, m, s) and exponents of angle, length and time."""

    scale: float
    exponents: tuple[Fraction, Fraction, Fraction] = (Fraction(0), Fraction(0), Fraction(0))

    def __mul__(self, other: "Unit") -> "Unit":
        a, b = self.exponents, other.exponents
        return Unit(self.scale * other.scale, (a[0] + b[0], a[1] + b[1], a[2] + b[2]))

    def __truediv__(self, other: "Unit") -> "Unit":
        a, b = self.exponents, other.exponents
        return Unit(self.scale / other.scale, (a[0] - b[0], a[1] - b[1], a[2] - b[2]))

    def __pow__(self, exponent: Fraction) -> "Unit":
        a = self.exponents
        scale = (
            math.sqrt(self.scale) if exponent == Fraction(1, 2) else self.scale ** float(exponent)
        )
        return Unit(scale, (a[0] * exponent, a[1] * exponent, a[2] * exponent))

    @property
    def dimension(self) -> str:
        """In words: "angle time^-1/2", or "1" where there is none."""
        named = [(name, e) for name, e in zip(_NAMES, self.exponents, strict=True) if e]
        return " ".join(name if e == 1 else f"{name}^{e}" for name, e in named) or "1"


@dataclass(frozen=True)
class LengthUnit:
    """A unit in which coordinates stand.

    Parameters
    ----------
    name : str
        Its name as the registry of CRSs has it.
    metres : float
        Its length, m.
    """

    name: str
    metres: float

    @property
    def plural(self) -> str:
        """The name of several."""
        return self.name.replace("foot", "feet") if "foot" in self.name else f"{self.name}s"


METRE = LengthUnit("metre", 1.0)
LENGTH_UNITS = {
    "m": METRE,
    "ft": LengthUnit("foot", FOOT_M),
    "us-ft": LengthUnit("US survey foot", US_FOOT_M),
}
"""Units of lengths that tables may stand in, by the names that PROJ has for them."""


DEG = math.pi / 180.0  # rad of a degree
ARCSEC = DEG / 3600.0  # rad of a second of arc
# exponents of angle, length and time: the units of that dimension in rad, m and s
_OF_DIMENSION: dict[tuple[int, int, int], dict[str, float]] = {
    (0, 0, 0): {"1": 1.0, "%": 1e-2, "ppt": 1e-3, "ppm": 1e-6},
    (1, 0, 0): {
        **{"rad": 1.0, "mrad": 1e-3, "urad": 1e-6},
        **{"deg": DEG, "arcmin": DEG / 60.0, "arcsec": ARCSEC},
    },
    (0, 1, 0): {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3},
    (0, 0, 1): {"s": 1.0, "ms": 1e-3, "min": 60.0, "day": 86400.0, "h": 3600.0, "hr": 3600.0},
    (0, 0, -1): {"Hz": 1.0},
    (0, 1, -2): {
        **{"g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY, "ug": 1e-6 * STANDARD_GRAVITY},
        **{"Gal": 1e-2, "mGal": 1e-5},
    },
}
UNITS: dict[str, Unit] = {
    name: Unit(scale, (Fraction(angle), Fraction(length), Fraction(time)))
    for (angle, length, time), units in _OF_DIMENSION.items()
    for name, scale in units.items()
}

_NUMBER = re.compile(r"\s*([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)", re.ASCII)
_TOKEN = re.compile(r"\s*([A-Za-z%]+|[-+]?\d+(?:\.\d+)?|[*/^()])", re.ASCII)


# characters and exponent of a unit: more than a person writes
LONGEST_UNIT, LARGEST_EXPONENT = 100, 10.0


class _Parser:
    """Recursive descent over the tokens of one unit."""

    def __init__(self, text: str, quantity: str) -> None:
        self.quantity = quantity
        if len(text) > LONGEST_UNIT:
            self.quantity = f"{quantity[:40]}..."
            raise self.refused(f"a unit of {len(text)} characters (limit {LONGEST_UNIT})")
        self.tokens: list[str] = []
        position = 0
        text = text.rstrip()
        while position < len(text):
            match = _TOKEN.match(text, position)
            if match is None:
                raise self.refused(f"{text[position:].strip()!r} does not belong in a unit")
            self.tokens.append(match.group(1))
            position = match.end()

    def refused(self, problem: str, example: str = "'deg/h/sqrt(Hz)'") -> InputError:
        return InputError(f"{self.quantity!r}: {problem}; write as in {example}")

    def _next(self) -> str:
        return self.tokens.pop(0) if self.tokens else ""

    def _expect(self, token: str) -> None:
        actual = self._next()
        if actual != token:
            raise self.refused(f"{token!r} expected, found {actual or 'the end'!r}")

    def whole(self) -> Unit:
        unit = self.product()
        if self.tokens:
            raise self.refused(f"{self.tokens[0]!r} must be joined by * or /")
        return unit

    def product(self) -> Unit:
        unit = self.factor()
        while self.tokens and self.tokens[0] in "*/":
            unit = unit * self.factor() if self._next() == "*" else unit / self.factor()
        return unit

    def factor(self) -> Unit:
        unit = self.base()
        if self.tokens and self.tokens[0] == "^":
            self._next()
            exponent = self._next()
            number = re.fullmatch(r"[-+]?\d+(\.\d+)?", exponent)
            if not number or abs(float(exponent)) > LARGEST_EXPONENT:
                problem = f"{exponent or 'the end'!r} is no exponent"
                raise self.refused(problem, "'s^2' or 's^-0.5'")
            unit = unit ** Fraction(exponent)
        return unit

    def base(self) -> Unit:
        name = self._next()
        if name == "sqrt" or name == "(":
            if name == "sqrt":
                self._expect("(")
            unit = self.product()
            self._expect(")")
            return unit ** Fraction(1, 2) if name == "sqrt" else unit
        if name in UNITS:
            return UNITS[name]
        if not name[:1].isalpha():
            raise self.refused(f"a unit is expected where {name or 'the end'!r} stands")
        raise InputError(f"{self.quantity!r}: unknown unit {name!r}; {near(name, UNITS, 0.5)}")


def is_number(value: Any) -> bool:
    """Whether a value is a finite real number that fits into a float, true and false not among."""
    real = isinstance(value, Real) and not isinstance(value, bool)
    return real and abs(value) <= sys.float_info.max


def spells_zero(text: str) -> bool:
    """Tell whether a number whose float is zero is zero, and not one too small for a float."""
    return not any(digit in text.lower().partition("e")[0] for digit in "123456789")


def exact_float(text: str) -> float:
    """Return the number of a text; ValueError where it is too small for one and would be zero."""
    x = float(text)
    if x == 0.0 and not spells_zero(text):
        raise ValueError(f"{text[:40]} is too small a number; write 0")
    return x


def parse_unit(text: str) -> Unit:
    """Return the unit of an expression such as "deg/s^2/sqrt(Hz)".

    Raises
    ------
    InputError
        Where a unit is unknown; the message names the nearest one.
    """
    return _Parser(_plain(text), text).whole()


def parse_quantity(text: object, dimension: str) -> float:
    """Value in SI (rad, m, s) of a number with its unit.

    Parameters
    ----------
    text : such as "0.24 deg/sqrt(h)".
    dimension : any unit of the wanted dimension, such as "deg/h/sqrt(Hz)"; the error message shows
        it as the example.

    Raises
    ------
    InputError
        Where the number or its unit is missing, the unit is unknown or of another dimension.
    """
    expected = parse_unit(dimension)
    example = f"{expected.dimension} is expected, as in '1 {dimension}'"
    if not isinstance(text, str):
        raise InputError(f"{text!r} has no unit; {example}")
    match = _NUMBER.match(text)
    if match is None:
        raise InputError(f"{text!r} does not start with a number; {example}")
    value, unit_text = float(match.group(1)), _plain(text[match.end() :])
    if not math.isfinite(value) or (value == 0.0 and not spells_zero(match.group(1))):
        raise InputError(f"{text!r} is too large or too small a number; {example}")
    if not unit_text.strip():
        if expected.exponents != UNITS["1"].exponents:
            raise InputError(f"{text!r} has no unit; {example}")
        return value
    unit = _Parser(unit_text, text).whole()
    if unit.exponents != expected.exponents:
        raise InputError(f"{text!r} is of dimension {unit.dimension}; {example}")
    if not (value == 0.0 or SMALLEST_UNIT < abs(value * unit.scale) < LARGEST_UNIT):
        raise InputError(
            f"{text!r} is outside of {SMALLEST_UNIT:g} to {LARGEST_UNIT:g} in SI units; {example}"
        )
    return value * unit.scale


def round_in_unit(value: float, unit: str, digits: int) -> float:
    """Round `value` (SI) to so many digits in `unit`; SI, as `parse_quantity` reads the text."""
    return parse_quantity(f"{value / parse_unit(unit).scale:.{digits}g} {unit}", unit)


def format_quantity(value: float, unit: str) -> str:
    """Return the shortest text in `unit` that `parse_quantity` turns back into exactly `value`.

    `value` is SI; the text has SI units where no text in `unit` does.
    """
    scale = parse_unit(unit).scale
    for digits in range(1, 18):
        number = float(f"{value / scale:.{digits}g}")
        if number * scale == value:
            return f"{number!r} {unit}".replace(".0 ", " ")
    return f"{value!r} {_si(parse_unit(unit))}"


def _si(unit: Unit) -> str:
    """The same dimension written in rad, m and s."""
    parts = [
        name if e == 1 else f"{name}^{float(e):g}"
        for name, e in zip(("rad", "m", "s"), unit.exponents, strict=True)
        if e
    ]
    return "*".join(parts) or "1"


def _plain(text: str) -> str:
    return text.replace("\u00b5", "u").replace("\u03bc", "u")


def time_zone(name: str) -> tzinfo:
    """Return a time zone of clocks.

    Parameters
    ----------
    name : str
        Name of the IANA data base ("Europe/Zurich") or offset against UTC ("+02:00").

    Returns
    -------
    tzinfo
        The zone; its name is "CEST" or "UTC+02:00".

    Raises
    ------
    UsageError
        For a text that names none, or none that this machine knows.
    """
    if offset := re.fullmatch(r"(?:utc)?([+-])(\d{1,2}):(\d{2})", name, re.IGNORECASE):
        minutes = 60 * int(offset[2]) + int(offset[3])
        if minutes < 24 * 60:
            return timezone(timedelta(minutes=-minutes if offset[1] == "-" else minutes))
    try:
        return ZoneInfo(name)
    except (KeyError, ValueError, OSError) as error:
        raise UsageError(
            f'time zone {name!r} is unknown to this computer; give a name such as "Europe/Zurich" '
            'or an offset such as "+02:00"'
        ) from error
