"""Values of a table of the flight file: what TOML adds to the kinds of options.

A value is judged by `io.options.kinds.accepted`, and its refusal gets file and line.
`VALUE_READERS` has
the kinds whose values TOML writes otherwise than a record holds them: paths, which are relative to
the file and must be there, and tables within a table.
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from ...base.errors import InputError, OptionError
from ...base.files import expand_patterns, is_pattern
from ...base.inputs import is_file
from ...base.tables import OptionTable
from ...gnss.covariance_model import CovarianceModel
from ...gnss.ppk_options import ENGINES
from ...io.options.camera_options import CameraMounting
from ...io.options.kinds import accept_value
from ...io.options.schema import Declared, declared_options, options_of
from ...navigation.noise_model.model import shipped_models
from ...records.cameras.mounting import Mounting
from .imu_options import neither_model_nor_file

Record = TypeVar("Record")


def known_keys(tables: Mapping[str, tuple[type, ...]]) -> dict[str, tuple[str, ...]]:
    """The keys of every table of a file, the sub-tables among them."""
    keys = {name: tuple(item.name for item in options_of(name, tables[name])) for name in tables}
    for name in tables:
        for item in options_of(name, tables[name]):
            if item.option.members is not None:
                keys[f"{name}.{item.name}"] = item.option.members()
    return keys | {"": (*keys[""], *(name for name in tables if name and "." not in name))}


def take(table: OptionTable, kind: type, without: Iterable[str] = ()) -> dict[str, Any]:
    """The values of all options of a table by name, with the defaults of those that are absent.

    Parameters
    ----------
    table : OptionTable
        Its name says which options a shared dataclass has there.
    kind : type
        The dataclass that declares the options.
    without : Iterable[str]
        Options that are left out.
    """
    left_out = set(without)
    return {
        item.name: value_of(table, item)
        for item in options_of(table.name, (kind,))
        if item.name not in left_out
    }


def value_of(table: OptionTable, item: Declared) -> Any:
    """The value of an option, its default where it is absent."""
    key = item.name
    if key not in table.data and not item.required:
        return item.default
    if key not in table.data and item.kind == "name":
        return table.path.absolute().parent.name
    if key not in table.data:
        raise table.error(key, "is missing; it has no default")
    value = table.data[key]
    if value == "" or (isinstance(value, list) and "" in value):
        raise table.error(key, "is an empty text")
    if isinstance(value, dict) and table.full(key) in table.keys:
        table.table(key)  # refuses unknown keys
    if item.kind in VALUE_READERS:
        value = VALUE_READERS[item.kind](table, key, value)
    try:
        return accept_value(item, value, key)
    except OptionError as refusal:
        raise table.refusal(refusal) from None


def made(table: OptionTable, kind: Callable[..., Any], values: dict[str, Any]) -> Any:
    """The dataclass of a table; what it refuses at construction is told at the line of the key."""
    try:
        return kind(**values)
    except OptionError as refusal:
        raise table.refusal(refusal) from None


def record_of(
    table: OptionTable, kind: type[Record], without: Iterable[str] = (), **more: Any
) -> Record:
    """The dataclass of a table: its options as the table has them, and further fields.

    Parameters
    ----------
    table : OptionTable
        A table of the file.
    kind : type
        The dataclass that declares its options.
    without : Iterable[str]
        Options that are not taken from the table.
    more
        Fields that are no option of the table, and those that are not taken from it.
    """
    record: Record = made(table, kind, take(table, kind, without) | more)
    return record


def directory_of(table: OptionTable, directory: Path) -> Path:
    """The directory of products, from that of the file on; a file in its place is refused."""
    resolved = table.resolve(directory)  # of the flight, whatever file says it
    if resolved.exists() and not resolved.is_dir():
        raise table.error("directory", f"{resolved} is a file, a directory is expected")
    return resolved


def covariance_of(table: OptionTable) -> CovarianceModel:
    """The covariance model with the changes of a table."""
    options = declared_options(CovarianceModel)
    changes = {key: value_of(table, options[key]) for key in table.data}
    return CovarianceModel().with_changes(changes)


def _existing(table: OptionTable, key: str, value: Any) -> Any:
    """The path of a file or directory that is there."""
    return _values_present(table, key, [table.resolve(table.text(key), key)], Path.exists)[0]


def _file_or_directory(table: OptionTable, key: str, value: Any) -> Any:
    """The path of a directory, or of a file that is there and not empty."""
    path = table.resolve(table.text(key), key)
    return path if path.is_dir() else table.file(key)


def _images(table: OptionTable, key: str, value: Any) -> Any:
    """A directory of images, or a list of their names."""
    path = table.resolve(table.text(key), key)
    if not path.exists():
        advice = "give the directory of the images or a list of their names in order"
        raise table.error(key, f"{path} does not exist; {advice}")
    return path


def _files(table: OptionTable, key: str, value: Any) -> Any:
    """The paths of files that are there."""
    return _values_present(table, key, [table.resolve(name, key) for name in table.texts(key, ())])


def _observations(table: OptionTable, key: str, value: Any) -> Any:
    """The path of a file, or of several: a list of names and patterns such as base/*.18o."""
    if isinstance(value, str) and not is_pattern(value):
        return table.file(key)
    names = (value,) if isinstance(value, str) else table.texts(key, ())
    paths = _values_present(
        table, key, list(expand_patterns(table.resolve(name, key) for name in names))
    )
    if not paths:
        raise table.error(key, "is an empty list; name the files")
    return paths[0] if len(paths) == 1 else paths


def _values_present(
    table: OptionTable, key: str, paths: list[Path], exists: Callable[[Path], bool] = is_file
) -> list[Path]:
    """The paths; a refusal names the first of them that does not exist."""
    if missing := [path for path in paths if not exists(path)]:
        where = f"paths are relative to {table.source(key).path.name}"
        raise table.error(key, f"{missing[0]} does not exist; {where}")
    return paths


def _engine(table: OptionTable, key: str, value: Any) -> Any:
    """The name of a known engine: no file names a program that is run."""
    engine = table.text(key)
    if engine not in ENGINES:
        engines = ", ".join(ENGINES)
        problem = f"{engine!r} is none of {engines}; a program is given only on the command line"
        raise table.error(key, f"{problem}: insgnss process --engine PROGRAM")
    return engine


def _noise(table: OptionTable, key: str, value: Any) -> Any:
    """Name of a shipped noise model, or the path of an existing file."""
    noise: str = table.text(key)
    if noise in shipped_models():
        return noise
    if not table.resolve(noise, key).is_file():
        remark = f" (paths are relative to {table.source(key).path.name})"
        raise table.error(key, neither_model_nor_file(noise, remark))
    return table.file(key)


def _rate(table: OptionTable, key: str, value: Any) -> Any:
    """Hz, None for every sample."""
    if value == "imu":
        return None
    if isinstance(value, str):
        raise table.error(key, f'{value!r} is neither a number of Hz nor "imu"')
    return value


def _angles(table: OptionTable, key: str, value: Any) -> Any:
    """Angle set and angles of ``boresight_deg = { angle_set = [..] }``."""
    if "boresight" in table.data:
        raise table.error(key, f"{table.name}.boresight is given as well; keep one of them")
    pairs = [*value.items()] if isinstance(value, dict) else []
    return pairs[0] if len(pairs) == 1 else value


def _camera_mounting(table: OptionTable, key: str, value: Any) -> Any:
    """Place and attitude of a further camera; a matrix is a rotation."""
    mounted = table.table(key)
    mounting = record_of(mounted, CameraMounting)
    try:
        mounting.on(Mounting())
    except InputError as refusal:
        raise mounted.error(refusal.key, refusal.problem) from None
    return mounting


VALUE_READERS: dict[str, Callable[[OptionTable, str, Any], Any]] = {
    "angles": _angles,
    "camera_mounting": _camera_mounting,
    "covariance": lambda table, key, value: covariance_of(table.table(key)),
    "directory": lambda table, key, value: table.text(key),
    "engine": _engine,
    "existing": _existing,
    "file": lambda table, key, value: table.file(key),
    "file_or_directory": _file_or_directory,
    "files": _files,
    "images": _images,
    "noise": _noise,
    "observations": _observations,
    "rate": _rate,
}
