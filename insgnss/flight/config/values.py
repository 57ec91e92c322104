"""Values of a table of the flight file: one reader for each kind of option.

Readers of plain kinds stand in `kinds`; here those that know more of their option.
"""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from ...base.errors import InputError, OptionError, UsageError
from ...base.tables import Table, near
from ...gnss.covariance_model import CovarianceModel, triple
from ...gnss.ppk_options import Air, rtklib_problem
from ...io.formats import UNITS, unit_factor
from ...io.formats.text.units import imu_kinds
from ...io.options.camera_options import CameraMounting
from ...io.options.schema import Declared, declared, options_of
from ...navigation.noise_model.model import shipped_models
from ...records.cameras.mounting import ANGLE_SETS, MAX_LEVER_M, Mounting
from .imu_options import ImuInput, neither_model_nor_file
from .kinds import PLAIN, choice, number, numbers, text, texts


def take(table: Table, classes: Iterable[type], without: Iterable[str] = ()) -> dict[str, Any]:
    """The values of all options of a table by name, with the defaults of those that are absent.

    Parameters
    ----------
    table : Table
        Its name says which options a shared dataclass has there.
    classes : Iterable[type]
        The dataclasses that declare the options.
    without : Iterable[str]
        Options that are left out.
    """
    left_out = set(without)
    return {
        item.name: value_of(table, item)
        for item in options_of(table.name, tuple(classes))
        if item.name not in left_out
    }


def value_of(table: Table, item: Declared) -> Any:
    """The value of an option, its default where it is absent."""
    if item.name not in table.data and not item.required:
        return item.default
    return READERS[item.kind](table, item)


def _noise(table: Table, item: Declared) -> str | Path:
    """Name of a shipped noise model, or the path of an existing file."""
    noise: str = table.text(item.name)
    if noise in shipped_models():
        return noise
    if not table.resolve(noise, item.name).is_file():
        of = table.source(item.name).path.name
        problem = neither_model_nor_file(noise, f" (paths are relative to {of})")
        raise table.error(item.name, problem)
    return table.file(item.name)


def _sign(table: Table, item: Declared) -> float:
    sign: float = table.number(item.name)
    if abs(sign) != 1.0:
        problem = f"{sign:g} is neither 1 (specific force) nor -1 (its reverse)"
        raise table.error(item.name, problem)
    return sign


def is_unit(text: str, kind: str) -> bool:
    """Whether `text` is a unit of this kind, with or without a number before it."""
    try:
        unit_factor(text, kind)
    except UsageError:
        return False
    return True


def _imu_units(table: Table, item: Declared) -> dict[str, str] | None:
    """Units of gyro, accel and time as far as given, of the dimension that the quantity has."""
    units, quantity = table.table(item.name), value_of(table, declared(ImuInput)["quantity"])
    right = dict(zip(("gyro", "accel"), imu_kinds(quantity), strict=True))
    for sensor in units.data:
        unit, kind = units.text(sensor), right.get(sensor, sensor)
        if is_unit(unit, kind):
            continue
        units_of_kind = ", ".join(UNITS[kind])
        count = "a number may stand before it (of one count: 0.05 deg/s)"
        advice = f"{near(unit, tuple(UNITS[kind]))}; {count}"
        homes = [name for name in UNITS if is_unit(unit, name)]
        if kind.partition(" ")[0] in [name.partition(" ")[0] for name in homes]:
            advice = f'it does not belong to quantity = "{quantity}"; use {units_of_kind}'
        elif homes:
            advice = f"it belongs to the other sensor; use {units_of_kind}"
        raise units.error(sensor, f"{unit!r} is no unit for it: {advice}")
    return dict(units.data) or None


def _gnss_units(table: Table, item: Declared) -> dict[str, str] | None:
    """Units of the keys of `gnss_text` as far as given; of quality, whose codes they are."""
    from ...io.formats.gnss.fixes import QUALITY_CODES

    units = table.table(item.name)
    for quantity in units.data:
        if quantity == "quality":
            units.choice(quantity, QUALITY_CODES, QUALITY_CODES[0])
            continue
        unit, kind = units.text(quantity), "angle" if quantity == "course" else quantity
        if not is_unit(unit, kind):
            units_of_kind = tuple(UNITS[kind])
            raise units.error(quantity, f"{unit!r} is no unit for it: {near(unit, units_of_kind)}")
    return dict(units.data) or None


def _quality_sigmas(table: Table, item: Declared) -> dict[str, tuple[float, ...]]:
    given = table.table(item.name)
    return {name: given.sigmas(name, None) for name in given.data}


def _gm_sigma(table: Table, item: Declared) -> float | str:
    """A number, or one of two words."""
    if isinstance(table.data[item.name], str):
        return choice(table, item)
    return number(table, item)


def _rtklib(table: Table, item: Declared) -> dict[str, str]:
    """Further options of RTKLIB; names and values are those of its option file."""
    given = table.value(item.name, dict, {})
    for name, value in given.items():
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            expected = "expected a number or a text, as in RTKLIB's option file"
            raise table.error(item.name, f"{name} = {value!r}, {expected}")
        if problem := rtklib_problem(name, str(value)):
            raise table.error(item.name, problem)
    return {name: str(value) for name, value in given.items()}


def _air(table: Table, item: Declared) -> dict[str, float] | None:
    """Air at the base, as far as it is given."""
    air = table.table(item.name)
    return {name: number(air, declared(Air)[name]) for name in air.data} or None


def _lever(table: Table, item: Declared) -> tuple[float, ...]:
    lever = numbers(table, item)
    length = sum(x * x for x in lever) ** 0.5
    if length >= MAX_LEVER_M:
        problem = f"is {length:.0f} m long (limit {MAX_LEVER_M:.0f} m); the unit is m"
        raise table.error(item.name, f"{list(lever)} {problem}")
    return lever


def _angles(table: Table, item: Declared) -> tuple[str, tuple[float, ...]]:
    """Angle set and angles of ``boresight_deg = { angle_set = [..] }``."""
    if "boresight" in table.data:
        problem = f"{table.name}.boresight is given as well; keep one of them"
        raise table.error(item.name, problem)
    given = table.data[item.name]
    if not isinstance(given, dict) or len(given) != 1:
        angle_sets = ", ".join(ANGLE_SETS)
        problem = f"name one angle set, such as {{ opk = [..] }}; known are {angle_sets}"
        raise table.error(item.name, problem)
    named = table.table(item.name)
    return next((angle_set, named.numbers(angle_set, 3)) for angle_set in named.data)


def _camera_mounting(table: Table, item: Declared) -> CameraMounting:
    """Place and attitude of a further camera; a matrix is a rotation."""
    mounted = table.table(item.name)
    values = take(mounted, [CameraMounting])
    try:
        mounting = CameraMounting(**values)
    except OptionError as refusal:
        raise mounted.error(refusal.key.rpartition(".")[2], refusal.problem) from None
    try:
        mounting.on(Mounting())
    except InputError as refusal:
        key, _, problem = str(refusal).partition(": ")
        raise mounted.error(key, problem) from None
    return mounting


def _rate(table: Table, item: Declared) -> float | None:
    """Hz, None for every sample."""
    rate = table.data[item.name]
    if rate == "imu":
        return None
    if isinstance(rate, str):
        raise table.error(item.name, f'{rate!r} is neither a number of Hz nor "imu"')
    return number(table, item)


def _covariance(table: Table, item: Declared) -> CovarianceModel:
    return covariance_of(table.table(item.name))


def covariance_of(table: Table) -> CovarianceModel:
    """The covariance model with the changes of a table."""
    options = declared(CovarianceModel)
    return CovarianceModel().with_changes(
        {key: value_of(table, options[key]) for key in table.data}
    )


def _triple(table: Table, item: Declared) -> tuple[float, ...]:
    return _checked_triple(table, item.name, item)


def _triples(table: Table, item: Declared) -> dict[str, tuple[float, ...]]:
    classes = table.table(item.name)
    return {name: _checked_triple(classes, name, item) for name in classes.data}


def _checked_triple(table: Table, key: str, item: Declared) -> tuple[float, ...]:
    """North, east, down, or one number for all of them."""
    given = table.numbers(key, 3) if isinstance(table.data[key], list) else table.number(key)
    try:
        return triple(item, given, "" if key == item.name else key)
    except OptionError as refusal:
        raise table.error(key, refusal.problem) from None


READERS: dict[str, Callable[[Table, Declared], Any]] = {
    **PLAIN,
    "air": _air,
    "angles": _angles,
    "camera_mounting": _camera_mounting,
    "axes": text,  # it is checked at construction, as formats are
    "covariance": _covariance,
    "formats": texts,
    "gm_sigma": _gm_sigma,
    "gnss_units": _gnss_units,
    "imu_units": _imu_units,
    "lever": _lever,
    "noise": _noise,
    "quality_sigmas": _quality_sigmas,
    "rate": _rate,
    "rtklib": _rtklib,
    "sign": _sign,
    "triple": _triple,
    "triples": _triples,
}
