"""What a field of a header says: its quantity, and a unit in brackets or behind the name.

    Gyro X (deg/s)   gyro_x [dps]   gyro_x_deg_s   GyroX_deg_per_s   Acc_Z [m/s^2]   acc_z_m_s2
    ax_mg
    time_us   TimeUS   lat_rad   latRad   pos_rad[1]   alt_mm   vn_cm_s   speed_kmh   course_deg

A unit in brackets is the unit of the field, whatever it is. Behind a name, where anything may
stand, only a unit of the kind that the column is of is one: of a sensor behind the letter or number
of its axis; of a time (s, ms, us, ns), an angle, a length or a velocity behind an underscore or
where a capital begins, and of a few words for a latitude, a longitude, a course and a clock without
either.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from ....base.errors import InputError, UsageError
from ....base.wording import set_to, spell
from ....records import Finding
from .order import note
from .units import SENSOR_SCALES, factor_of, unit_factor, unit_name

Kinds = Mapping[str, tuple[str, ...]]

TIME_UNITS = ("s", "ms", "us", "ns")
TIME_FACTORS = {unit: SENSOR_SCALES["time"][unit] for unit in TIME_UNITS}
SENSORS = ("gyro", "accel")
KIND_OF = {"course": "angle", "sigma": "length"}  # kinds of units by their key, where it is another
UNIT_AS = {"sigma": "length"}  # key whose unit another one has where none is stated
_OF_AXIS = re.compile(r"(.*(?:[xyz]|[a-w]_?[0-3])|[pqr])_?([a-z°µ].*)")
_GLUED = {
    "angle": re.compile(
        r"((?:.*_)?(?:lat(?:itude)?|lon(?:g|gitude)?|lng|course|cog))((?:deg|rad).*)"
    ),
    "time": re.compile(
        r"((?:.*_)?(?:time|timestamp|stamp|tow|clock|t))([mun]s(?:ec)?|sec(?:ond)?s?)"
    ),
}
_SHORT = {  # behind a name only, where the kind tells what is meant
    "gyro": {"rps": "rad/s", "rads": "rad/s", "degs": "deg/s"},
    "accel increment": {"ms": "m/s"},
    "velocity": {"ms": "m/s", "cms": "cm/s", "mms": "mm/s"},
}
DATUM = re.compile(r"\s*WGS[ -]?(19)?84\s*", re.IGNORECASE)  # in the brackets of a unit
LONGEST_COLUMN_NAME = 200  # characters: a longer field of a header is no name
_SAME = 1e-6  # relative difference of two factors: rounding


def normalise_header(name: str) -> tuple[str, str | None]:
    """Return a header name in lower case with underscores, and the unit in its brackets.

    A number in brackets is an index, part of the name.
    """
    name = re.sub(r"[(\[](\d+)[)\]]", r"_\1", name)
    text = name.strip()
    text = text[text[:1] in ("'", '"') :]
    text = text[: len(text) - (text[-1:] in ("'", '"'))].strip()
    match = re.fullmatch(r"([^(\[]*)(?:[(\[]([^)\]]*)[)\]])?", text)
    head, unit = match.groups() if match else (name, None)
    unit = None if re.fullmatch(DATUM, unit or "") else unit
    return re.sub(r"[\s\-./]+", "_", head.lower()).strip("_"), unit.strip() if unit else None


def kinds_like(kind: str) -> tuple[str, ...]:
    """Return the kinds of units that may stand behind a name where one of `kind` is looked for.

    A sensor has rates and increments; lengths go with the angles that standard deviations of a
    latitude are sometimes given in.
    """
    sensor = kind.partition(" ")[0]
    if sensor in SENSORS:
        return (sensor, f"{sensor} increment")
    return ("length", "angle") if kind == "length" else (kind,)


def unit_in(field: str, kinds: Sequence[str]) -> str | None:
    """Return the unit that a field gives, else None.

    It stands in brackets, or behind the name where it is of one of `kinds`.
    """
    unit = normalise_header(field)[1]
    return unit or next(
        (unit for _, unit in without_unit(re.sub(r"[(\[]\d+[)\]]\s*$", "", field), kinds)), None
    )


def without_unit(field: str, kinds: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield name and unit of a field whose name ends in a unit of one of `kinds`.

    The name is in lower case with underscores.
    """
    plain, humped = (
        normalise_header(text)[0] for text in (field, re.sub(r"(?<=[a-z\d])(?=[A-Z])", "_", field))
    )
    for kind in kinds:
        units = TIME_UNITS if kind == "time" else SENSOR_SCALES[kind]
        for head in dict.fromkeys((plain, humped)):
            for stem, tail in _cuts(head, kind):
                spelled = unit_name(re.sub(r"_(per_)?", "/", re.sub(r"_(\d)$", r"\1", tail)))
                spelled = unit_name(_SHORT.get(kind, {}).get(tail, spelled))
                yield from ((stem, unit) for unit in units if unit_name(unit) == spelled)


def _cuts(head: str, kind: str) -> Iterator[tuple[str, str]]:
    """Yield where a normalised name may end and a unit of a kind begin."""
    if kind.partition(" ")[0] in SENSORS:
        if match := _OF_AXIS.fullmatch(head):
            yield match[1], match[2]
        return
    yield from ((head[: bar.start()], head[bar.end() :]) for bar in re.finditer("_", head))
    if kind in _GLUED and (match := _GLUED[kind].fullmatch(head)):
        yield match[1], match[2]


def names_of(fields: Sequence[str], names: Mapping[str, str], kinds: Kinds) -> list[str | None]:
    """Return the canonical name of each field, None where it has none.

    A field with a unit behind its name is one only where no field bears that name as it is: of
    `lat` and `lat_rad` it is `lat`.

    Parameters
    ----------
    fields : sequence of str
        Fields of the header.
    names : mapping
        Canonical name by alias.
    kinds : mapping
        Kinds of the units that may stand behind a canonical name.
    """
    fields = [field if len(field) <= LONGEST_COLUMN_NAME else "" for field in fields]
    plain = [names.get(normalise_header(field)[0]) for field in fields]
    return [
        name
        or (None if (canonical := _canonical_field(field, names, kinds)) in plain else canonical)
        for field, name in zip(fields, plain, strict=True)
    ]


def _canonical_field(field: str, names: Mapping[str, str], kinds: Kinds) -> str | None:
    """Return the canonical name of a field with a unit behind its name."""
    every = tuple(dict.fromkeys(kind for of_name in kinds.values() for kind in of_name))
    stems = dict.fromkeys(stem for stem, _ in without_unit(field, every))
    candidates = ((names[stem], stem) for stem in stems if stem in names)
    return next(
        (
            name
            for name, stem in candidates
            if any(stem == cut_stem for cut_stem, _ in without_unit(field, kinds.get(name, ())))
        ),
        None,
    )


def agreed_unit(
    path: object, line: int | None, names: str, fields: Sequence[str], kind: str
) -> str | None:
    """Return the unit that `fields` of the columns `names` give, None without one.

    Raises
    ------
    InputError
        A unit that is not of the kind.
    """
    stated = [unit for field in fields if (unit := unit_in(field, kinds_like(kind)))]
    factors = {factor_of(unit, (kind,)) for unit in stated}
    if len(factors) > 1 or None in factors:
        units = " and ".join(repr(unit) for unit in dict.fromkeys(stated))
        message = (
            f"the header gives the unit {units} for {names}, which is none of"
            f" {', '.join(SENSOR_SCALES[kind])} for them all; set {spell('units')}"
        )
        raise InputError.at_line(path, line, message)
    return stated[0] if stated else None


class Settled(NamedTuple):
    """Units and their factors by key, and the notes on them."""

    units: dict[str, str]
    factors: dict[str, float]
    notes: tuple[Finding, ...]


def settled_units(
    path: object,
    line: int | None,
    columns: Mapping[str, str],
    fields: Mapping[str, Sequence[str]],
    requested: Mapping[str, str],
    record: str,
    kinds: Mapping[str, str] | None = None,
) -> Settled:
    """Settle units: the caller's, else those that the fields give, else the first of their kind.

    Parameters
    ----------
    path, line
        File and line of the header, for messages.
    columns : mapping
        Canonical names of the columns of each key, blanks between them.
    fields : mapping
        What the file calls the columns of each key.
    requested : mapping
        The caller's units.
    record : str
        What the rows are of, for notes.
    kinds : mapping, optional
        Kind of the unit of each key, where it is not that of its name.

    Returns
    -------
    Settled
        With a note for each of the caller's units where the fields give another one.

    Raises
    ------
    InputError, UsageError
        A unit that is none, with `path` and `line`.
    """
    units: dict[str, str] = {}
    factors, notes = {}, []
    for key, names in columns.items():
        kind, unit = (kinds or KIND_OF).get(key, key), requested.get(key)
        stated = unit or agreed_unit(path, line, names, fields[key], kind)
        units[key] = stated or units.get(UNIT_AS.get(key, ""), next(iter(SENSOR_SCALES[kind])))
        try:
            factors[key] = unit_factor(units[key], kind)
        except UsageError as refusal:
            raise UsageError(f"{path}: unit of {names}: {refusal}") from None
        if unit and (header_unit := _other_unit(fields[key], kind, unit)):
            finding = f"the header says {header_unit}, and {set_to(f'units {key}', unit)} was taken"
            advice = f"leave {spell(f'units {key}')} out if the header is right"
            notes.append(note(f"{record} units", finding, "one unit", advice))
    return Settled(units, factors, tuple(notes))


def _other_unit(fields: Sequence[str], kind: str, requested: str) -> str | None:
    """Return the unit that one of `fields` gives where it is another than the caller's.

    What is no unit of such a column gives none.
    """
    taken = unit_factor(requested, kind)
    for unit in filter(None, (unit_in(field, kinds_like(kind)) for field in fields)):
        same = factor_of(unit, (kind,))
        if same is None:
            differs = factor_of(unit, kinds_like(kind)) is not None
        else:
            differs = abs(same / taken - 1.0) > _SAME
        if differs:
            return unit
    return None
