"""Readers of values of the plain kinds: numbers, words, files, places.

A reader takes the table of the file and the declared option, whose key is in the table or has no
default, and returns the value as the dataclass holds it. It raises InputError with file, line, key,
value and limit. Readers that know more of their option stand in `values`.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...base.files import expanded, is_pattern
from ...base.inputs import is_file
from ...base.tables import Table, near
from ...gnss.ppk_options import ENGINES
from ...io.options.schema import Declared, is_place, swapped


def flag(table: Table, item: Declared) -> bool:
    """True or false."""
    return table.flag(item.name, False)


def number(table: Table, item: Declared) -> float:
    """A finite number within the option's range."""
    value: float = table.number(item.name, ..., item.option.low, item.option.high)
    return value


def whole(table: Table, item: Declared) -> int:
    """A whole number within the option's range."""
    value = number(table, item)
    if value != int(value):
        raise table.error(item.name, f"{value:g} is no whole number")
    return int(value)


def numbers(table: Table, item: Declared) -> tuple[float, ...]:
    """As many finite numbers as the type of the option has."""
    values: tuple[float, ...] = table.numbers(item.name, item.count)
    if item.option.positive and min(values) <= 0.0:
        every = "both" if item.count == 2 else "all"
        raise table.error(item.name, f"{list(values)}: {every} must be greater than zero")
    return values


def sigmas(table: Table, item: Declared) -> tuple[float, ...]:
    """Three standard deviations greater than zero."""
    values: tuple[float, ...] = table.sigmas(item.name, None)
    return values


def text(table: Table, item: Declared) -> str:
    """A text that is not empty."""
    text: str = table.text(item.name)
    return text


def name(table: Table, item: Declared) -> str:
    """A text, by default the name of the directory."""
    name: str = table.text(item.name, table.path.absolute().parent.name)
    return name


def choice(table: Table, item: Declared) -> str:
    """One of the option's words."""
    word: str = table.choice(item.name, tuple(map(str, item.choices)), "")
    return word


def letters(table: Table, item: Declared) -> str:
    """A text of the option's letters."""
    letters: str = table.text(item.name)
    allowed = "".join(map(str, item.choices))
    if not set(letters) <= set(allowed):
        raise table.error(item.name, f"{letters!r} is no text of the letters {allowed}")
    return letters


def texts(table: Table, item: Declared) -> tuple[str, ...]:
    """A list of texts, none empty."""
    texts: tuple[str, ...] = table.texts(item.name, ())
    return texts


def names(table: Table, item: Declared) -> tuple[str, ...]:
    """Names of checks."""
    names, check_names = texts(table, item), tuple(map(str, item.choices))
    if odd := [name for name in names if name not in check_names]:
        raise table.error(item.name, f"{odd[0]!r} is no check; {near(odd[0], check_names)}")
    return names


def file(table: Table, item: Declared) -> Path:
    """The path of a file that is there and not empty."""
    return table.file(item.name)


def _absent(table: Table, key: str, path: Path) -> str:
    """Say that a path does not exist, and which file it is relative to."""
    return f"{path} does not exist; paths are relative to {table.source(key).path.name}"


def files(table: Table, item: Declared) -> tuple[Path, ...]:
    """The paths of files that are there."""
    files = tuple(table.resolve(name, item.name) for name in table.texts(item.name, ()))
    if missing := [file for file in files if not is_file(file)]:
        problem = _absent(table, item.name, missing[0])
        raise table.error(item.name, problem)
    return files


def observations(table: Table, item: Declared) -> Path | tuple[Path, ...]:
    """The path of a file, or of several: a list of names and patterns such as base/*.18o."""
    given = table.data.get(item.name)
    if isinstance(given, str) and not is_pattern(given):
        return table.file(item.name)
    names = (table.text(item.name),) if isinstance(given, str) else table.texts(item.name, ())
    paths = expanded(table.resolve(name, item.name) for name in names)
    if missing := [path for path in paths if not is_file(path)]:
        problem = _absent(table, item.name, missing[0])
        raise table.error(item.name, problem)
    if not paths:
        raise table.error(item.name, "is an empty list; name the files")
    return paths[0] if len(paths) == 1 else paths


def directory(table: Table, item: Declared) -> Path:
    """The name of a directory that is there or is to be made, relative to the file or absolute."""
    return Path(table.text(item.name))


def existing(table: Table, item: Declared) -> Path:
    """The path of a file or directory that is there."""
    path = table.resolve(table.text(item.name), item.name)
    if not path.exists():
        problem = _absent(table, item.name, path)
        raise table.error(item.name, problem)
    return path


def file_or_directory(table: Table, item: Declared) -> Path:
    """The path of a directory, or of a file that is there and not empty."""
    path = table.resolve(table.text(item.name), item.name)
    return path if path.is_dir() else table.file(item.name)


def images(table: Table, item: Declared) -> Path:
    """A directory of images, or a list of their names."""
    images = table.resolve(table.text(item.name), item.name)
    if not images.exists():
        advice = "give the directory of the images or a list of their names in order"
        raise table.error(item.name, f"{images} does not exist; {advice}")
    return images


def engine(table: Table, item: Declared) -> str:
    """The name of a known engine: no file names a program that is run."""
    engine: str = table.text(item.name)
    if engine not in ENGINES:
        engines = ", ".join(ENGINES)
        problem = f"{engine!r} is none of {engines}; a program is named on the command line alone"
        raise table.error(item.name, f"{problem}: insgnss process --engine PROGRAM")
    return engine


def columns(table: Table, item: Declared) -> Any:
    """A list of names, a table of them, or None."""
    return table.columns()


def geodetic_position(table: Table, item: Declared) -> tuple[float, ...]:
    """Latitude (deg), longitude (deg) and ellipsoidal height (m)."""
    coordinates: tuple[float, ...] = table.numbers(item.name, 3)
    if not is_place(*coordinates):
        problem = "is no latitude, longitude (deg), ellipsoidal height (m)"
        raise table.error(item.name, f"{list(coordinates)} {problem}")
    return coordinates


def origin(table: Table, item: Declared) -> tuple[float, ...]:
    """The same, of the tangent plane, with advice where it is missing."""
    if item.name not in table.data:
        problem = "is missing; give it, or leave the table out to have it from the first fix"
        raise table.error(item.name, problem)
    coordinates: tuple[float, ...] = table.numbers(item.name, 3)
    if not is_place(*coordinates):
        problem = f"{list(coordinates)} is no latitude, longitude, ellipsoidal height"
        raise table.error(item.name, f"{problem}; {swapped(*coordinates[:2])}")
    return coordinates


def event_numbers(table: Table, item: Declared) -> tuple[int, ...]:
    """Whole numbers from 1."""
    given = table.value(item.name, list, [])
    if not all(isinstance(k, int) and not isinstance(k, bool) and k > 0 for k in given):
        expected = "expected a list of whole numbers from 1, as the events are counted"
        raise table.error(item.name, f"{given}, {expected}")
    return tuple(given)


def matrix(table: Table, item: Declared) -> Any:
    """Three rows of three finite numbers."""
    return table.matrix(item.name)


PLAIN: dict[str, Callable[[Table, Declared], Any]] = {
    "choice": choice,
    "columns": columns,
    "directory": directory,
    "engine": engine,
    "event_numbers": event_numbers,
    "existing": existing,
    "file": file,
    "file_or_directory": file_or_directory,
    "files": files,
    "flag": flag,
    "images": images,
    "letters": letters,
    "matrix": matrix,
    "name": name,
    "names": names,
    "number": number,
    "numbers": numbers,
    "observations": observations,
    "origin": origin,
    "place": geodetic_position,
    "sigmas": sigmas,
    "text": text,
    "texts": texts,
    "whole": whole,
}
