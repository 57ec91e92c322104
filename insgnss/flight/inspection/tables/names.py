"""Names that columns go by, compared without case, blanks and signs, and the unknown table."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from ....io.formats import SENSOR_SCALES
from ....io.formats.names import GNSS, TIME, TRIADS, taken_by_inspect
from ....io.formats.text.headers import LONGEST_COLUMN_NAME, factor_of, unit_in, without_unit
from ....io.formats.text.units import usual_unit
from ....records import Array

RECEIVER = re.compile(
    "^(gps|gnss|rtk|ublox|location)"
)  # whose name stands before those of its columns
# words that call a triad of a sensor, whatever stands beside them, and words of something else
SENSOR_WORDS = {
    "gyro": re.compile(
        "gy|giro.*|gyr.*|omega|rates?|turnrate|drehraten?|winkelgeschwindigkeit(en)?|rotationsrate"
        "|ang(ular)?(vel(ocity)?|rate)|rot(ation)?(vel(ocity)?|rate|speed)"
    ),
    "accel": re.compile("ac|acc.*|xl|beschl(eunigung(en)?)?|(specific)?force|specific|sf"),
}
OF_ANOTHER = re.compile(
    "cov.*|bias.*|std.*|sd|sigma|var.*|rms|mag.*|earth|grav.*|user|lin(ear)?|linacc|free|sp|set.*"
    "|cmd|des(ired)?|target|delta|sum|temp.*|max|min|accuracy|offset|scale|misal.*|world|ned|enu"
)
AXES_OF_TRIADS = (
    *(tuple(axes) for axes in ("xyz", "012", "123")),
    *(("roll", "pitch", "yaw"), ("long", "lat", "vert")),
)
AXIS_WORDS = {axis for axes in AXES_OF_TRIADS for axis in axes if axis.isalpha()}
# kinds of the units of what is no clock
OF_VALUES = tuple(kind for kind in SENSOR_SCALES if kind != "time")


def squash_name(name: str) -> str:
    """Return a name without case, blanks and signs; brackets with a unit are left out."""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"[(\[](?!\d+[)\]])[^)\]]*[)\]]", "", name.lower()))


def spellings(name: str) -> list[str]:
    """Return the squashed name, also without the parts before its dots or slashes.

    So `field.header.stamp` is `stamp` too, and `/imu/data/gyro/x` is `x`.
    """
    return [squash_name(suffix) for suffix in _name_parts(name)]


def bare(name: str, kinds: Sequence[str]) -> list[str]:
    """Return the spellings of a name without a unit of one of `kinds`, where it has one."""
    return [
        squash_name(stem) for suffix in _name_parts(name) for stem, _ in without_unit(suffix, kinds)
    ]


def _name_parts(name: str) -> list[str]:
    """Name without brackets, and what follows each dot, :: or slash in it; of none an empty one."""
    name = name if len(name) <= LONGEST_COLUMN_NAME else ""
    plain = re.sub(r"[(\[](?!\d+[)\]])[^)\]]*[)\]]", "", name).strip().strip("\"'")
    parts = re.split(r"[./]" if plain.startswith("/") else r"::|\.", plain)
    return [".".join(parts[k:]) for k in range(len(parts))]


def words_and_axis(name: str) -> tuple[tuple[str, ...], str]:
    """Return the words of a name in lower case without that of its axis, and the axis.

    Words end at signs, at digits and where a capital begins: UncompGyroX, GYRO_XOUT, gyroADC[0],
    Drehrate X. The axis is empty where no word is one.
    """
    plain = re.sub(r"[(\[](?!\d+[)\]])[^)\]]*[)\]]", "", name[:LONGEST_COLUMN_NAME])
    spelled = re.findall(r"[^\W\d_]+|\d+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", plain).lower())
    terms = [word.removesuffix("out") or word for word in spelled]
    for k in range(len(terms) - 1, -1, -1):
        word = terms[k]
        if word in AXIS_WORDS:
            return (*terms[:k], *terms[k + 1 :]), word
        if any(form.fullmatch(word[:-1]) for form in SENSOR_WORDS.values()) and word[-1] in "xyz":
            return (*terms[:k], word[:-1], *terms[k + 1 :]), word[-1]
    return (tuple(terms[:-1]), terms[-1]) if terms and terms[-1] in "0123" else (tuple(terms), "")


CLOCK_NAMES, WEEK_NAMES = (frozenset(taken_by_inspect(TIME[x])) for x in ("tow", "week"))
INCREMENT_ROLES = {"theta0", "theta1", "theta2", "vel0", "vel1", "vel2", "dt"}
GYRO, ACCEL = ("gx", "gy", "gz"), ("ax", "ay", "az")


@dataclass(frozen=True)
class Roles:
    """Columns by canonical name, the clocks that may stamp them, units, and the reason.

    A clock is a column and its unit. `unread` gives, for columns of known names that are left out,
    the name and the reason.
    """

    columns: dict[str, int]
    clocks: dict[int, str] = field(default_factory=dict)
    week: int | None = None
    units: dict[str, str] = field(default_factory=dict)
    repeat_column: int | None = None
    how: str = "by the names of its columns"
    unread: dict[int, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class UnknownTable:
    """An unknown table: values (n, m) and the name of each column, or None.

    `fractions` maps, for a clock in two columns, that of the seconds to that of their fractions and
    what these are called (`FRACTIONS_S`); the values of the former are those of both.
    """

    values: Array
    names: tuple[str | None, ...]
    fractions: dict[int, tuple[int, str]] = field(default_factory=dict)

    @property
    def named(self) -> dict[str, int]:
        """Index by squashed name; the first of equal names."""
        columns: dict[str, int] = {}
        for k, name in enumerate(self.names):
            if name is not None:
                columns.setdefault(squash_name(name), k)
        for k, name in enumerate(self.names):
            for abbreviation in spellings(name)[1:] if name is not None else ():
                columns.setdefault(abbreviation, k)
        for k, name in enumerate(self.names):
            for abbreviation in bare(name, OF_VALUES) if name is not None else ():
                columns.setdefault(abbreviation, k)
        for name, k in list(columns.items()):
            columns.setdefault(RECEIVER.sub("", name), k)
        return columns

    def triad(self, sensor: str) -> dict[str, int]:
        """Columns of a sensor, gyro or accel, by canonical name, of the best names there are.

        Empty without any. Numbered columns that go on behind the third are none: which of them are
        x y z is then unknown.
        """
        names = self.named
        spelling = next((t for t in TRIADS[sensor] if all(name in names for name in t)), ())
        if not spelling:
            names = self._behind_a_word()
            spelling = next((t for t in TRIADS[sensor] if all(name in names for name in t)), ())
        if not spelling:
            return self._triad_by_words(sensor)
        if (
            spelling
            and spelling[2][-1].isdecimal()
            and f"{spelling[2][:-1]}{int(spelling[2][-1]) + 1}" in names
        ):
            return {}
        canonical = GYRO if sensor == "gyro" else ACCEL
        return {c: names[name] for c, name in zip(canonical, spelling, strict=False)}

    def _triad_by_words(self, sensor: str) -> dict[str, int]:
        """Columns of the first triad of a sensor one of whose words names it; empty without any."""
        columns: dict[tuple[str, ...], dict[str, int]] = {}
        for k, name in enumerate(self.names):
            for spelled in (name or "", *(stem for stem, _ in without_unit(name or "", OF_VALUES))):
                stem, axis = words_and_axis(spelled)
                columns.setdefault(stem, {}).setdefault(axis, k)
        for stem, by_axis in columns.items():
            pairs = ("".join(pair) for pair in pairwise((*stem, "")))
            if not any(SENSOR_WORDS[sensor].fullmatch(word) for word in (*stem, *pairs)):
                continue
            axes = [axes for axes in AXES_OF_TRIADS if by_axis.keys() - {""} == set(axes)]
            if axes and not any(map(OF_ANOTHER.fullmatch, stem)):
                names = GYRO if sensor == "gyro" else ACCEL
                return {c: by_axis[axis] for c, axis in zip(names, axes[0], strict=True)}
        return {}

    def _behind_a_word(self) -> dict[str, int]:
        """Index by what stands behind the first underscore: that of a chip, as in mpu_ax."""
        columns: dict[str, int] = {}
        for k, name in enumerate(self.names):
            columns.setdefault(squash_name((name or "").partition("_")[2]), k)
        if self.named.keys() >= INCREMENT_ROLES:  # of an Inertial Sense uINS
            columns |= {f"dtheta{axis}": self.named[f"theta{axis}"] for axis in range(3)}
            columns |= {f"dvel{axis}": self.named[f"vel{axis}"] for axis in range(3)}
        return columns

    def of_fixes(self) -> dict[str, int]:
        """Columns of fixes by canonical name, each under the best of its names that is there."""
        names = self.named
        return {
            role: names[name]
            for role, spelled in GNSS.items()
            if role not in TIME
            for name in reversed(taken_by_inspect(spelled))
            if name in names
        }

    def unit_of(self, column: int, kind: str) -> str | None:
        """Return the unit of a kind that the name of a column gives, as the readers take it.

        The unit is in brackets or behind the name; None without one.
        """
        name = self.names[column]
        unit = None if name is None else unit_in(name, (kind,))
        return None if unit is None or factor_of(unit, (kind,)) is None else usual_unit(unit, kind)
