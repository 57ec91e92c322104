"""The text of a noise-model file: to a model with a line for every refusal, and back (`data_specs`,
noise_model).

What is shared by the three axes stands in [gyro] or [accel], what differs in [gyro.x] ...; a
`standard_error` table stands beside the quantities that it is of.
"""

import re
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...base.errors import InputError, near
from ...base.files import lines_of
from ...base.tables import parse_toml
from ...base.units import format_quantity, parse_quantity
from .noise_model import (
    GAUSS_MARKOV,
    GM_KEYS,
    NOISE_UNITS,
    QUANTITIES,
    AxisNoise,
    GaussMarkov,
    NoiseModel,
    RecordingSource,
)

_AXES = ("x", "y", "z")
_ERROR = "standard_error"
_RECORDING_KEYS = ("file", "sha256", "samples", "sampling_rate")
_COMMENT_WIDTH = 118  # characters of a line of comment (chosen)


def model_of_text(path: Path, text: str) -> NoiseModel:
    """Model of the text of the file `path`. Raises InputError, with file and line, for what is no
    noise model.
    """
    return _Reader(path, text).model(parse_toml(path, text))


def text_of_model(model: NoiseModel, remarks: Sequence[str] = ()) -> str:
    """Text of a file that `model_of_text` turns back into the same model; the remarks stand above
    as comments.
    """
    lines = [line for remark in remarks for line in comment_lines(remark)]
    lines += [f"name = {_toml_text(model.name)}", f"source = {_toml_text(model.source)}"]
    if model.misfit:
        lines += ["misfit = [", *(f"  {_toml_text(sentence)}," for sentence in model.misfit), "]"]
    for recording in model.recordings:
        lines += [
            "",
            "[[recording]]",
            f"file = {_toml_text(recording.file)}",
            f"sha256 = {_toml_text(recording.sha256)}",
        ]
        lines += [
            f"samples = {recording.samples}",
            f'sampling_rate = "{format_quantity(recording.sampling_rate_hz, "Hz")}"',
        ]
    for sensor in ("gyro", "accel"):
        lines += _sensor_lines(sensor, getattr(model, sensor))
    return "\n".join(lines) + "\n"


@dataclass
class _Reader:
    """The tree of one file to a model; knows where in the file it stands."""

    path: Path
    text: str
    lines: dict[str, int] = field(init=False)

    def __post_init__(self) -> None:
        self.lines = dict(_key_lines(self.text))

    def error(self, where: str, problem: str) -> InputError:
        """Return the error at the line of `where`, or of the table around it."""
        location = where
        while location and location not in self.lines:
            location = location.rpartition(".")[0]
        return InputError.at_line(self.path, self.lines.get(location), f"{where}: {problem}")

    def checked_table(self, table: Any, where: str, keys: tuple[str, ...]) -> dict[str, Any]:
        """`table` when it is one and has no key but `keys`."""
        if not isinstance(table, dict):
            raise self.error(where, f"{table!r} stands where a table [{where}] is expected")
        for key in table:
            if key not in keys:
                raise self.error(
                    f"{where}.{key}" if where else key, f"unknown key; {near(key, keys)}"
                )
        return table

    def model(self, tree: dict[str, Any]) -> NoiseModel:
        self.checked_table(tree, "", ("name", "source", "misfit", "recording", "gyro", "accel"))
        misfit = tree.get("misfit", [])
        if not isinstance(misfit, list) or not all(isinstance(text, str) for text in misfit):
            raise self.error("misfit", f"{misfit!r} is no list of texts; put each in quotes")
        for key in ("name", "source"):
            if not isinstance(tree.get(key, ""), str):
                raise self.error(key, f"{tree[key]!r} is not text; put it in quotes")
        gyro, accel = (self.sensor(tree, sensor) for sensor in ("gyro", "accel"))
        return NoiseModel(
            tree.get("name", self.path.stem),
            tree.get("source", str(self.path)),
            gyro,
            accel,
            self.recordings(tree),
            tuple(misfit),
        )

    def recordings(self, tree: dict[str, Any]) -> tuple[RecordingSource, ...]:
        """[[recording]], as often as there are."""
        entries = tree.get("recording", [])
        if not isinstance(entries, list):
            raise self.error(
                "recording", "write [[recording]], with two brackets, once a recording"
            )
        return tuple(self.recording(entry, f"recording.{i}") for i, entry in enumerate(entries))

    def recording(self, entry: Any, where: str) -> RecordingSource:
        self.checked_table(entry, where, _RECORDING_KEYS)
        for key, kind, expected in (
            ("file", str, "a text"),
            ("sha256", str, "a text"),
            ("samples", int, "a whole number"),
        ):
            if not isinstance(entry.get(key), kind) or isinstance(entry[key], bool):
                raise self.error(
                    f"{where}.{key}" if key in entry else where,
                    f"{key} {entry.get(key)!r}, expected {expected}",
                )
        try:
            rate = parse_quantity(entry.get("sampling_rate"), "Hz")
        except InputError as error:
            raise self.error(f"{where}.sampling_rate", str(error)) from None
        return RecordingSource(entry["file"], entry["sha256"], entry["samples"], rate)

    def sensor(self, tree: dict[str, Any], sensor: str) -> tuple[AxisNoise, AxisNoise, AxisNoise]:
        if sensor not in tree:
            raise InputError.at_line(
                self.path, None, f"table [{sensor}] is missing; it needs at least white_noise"
            )
        table = self.checked_table(
            tree[sensor], sensor, (*QUANTITIES, GAUSS_MARKOV, _ERROR, *_AXES)
        )
        common = self.quantities(
            {key: value for key, value in table.items() if key not in _AXES}, sensor, sensor
        )
        x, y, z = (self.axis(table.get(axis, {}), common, sensor, axis) for axis in _AXES)
        return x, y, z

    def axis(self, table: Any, common: dict[str, Any], sensor: str, axis: str) -> AxisNoise:
        where = f"{sensor}.{axis}"
        own = self.quantities(
            self.checked_table(table, where, (*QUANTITIES, GAUSS_MARKOV, _ERROR)), sensor, where
        )
        inherited = {
            name: sigma
            for name, sigma in common[_ERROR].items()
            if (name if name in QUANTITIES else GAUSS_MARKOV) not in own
        }
        merged = {**common, **own, _ERROR: inherited | own[_ERROR]}
        if "white_noise" not in merged:
            raise self.error(
                where,
                f"white_noise is missing; give it in [{sensor}], as in '1"
                f" {NOISE_UNITS[sensor]['white_noise']}'",
            )
        try:
            return AxisNoise(**merged)
        except InputError as error:
            raise self.error(where, str(error)) from None

    def quantities(self, table: dict[str, Any], sensor: str, where: str) -> dict[str, Any]:
        """The keyword arguments of `AxisNoise` that `table` holds."""
        plain = [key for key in table if key not in (GAUSS_MARKOV, _ERROR)]
        out: dict[str, Any] = {
            key: self.value(table[key], sensor, key, f"{where}.{key}") for key in plain
        }
        errors = self.errors(table.get(_ERROR, {}), sensor, f"{where}.{_ERROR}", QUANTITIES)
        if GAUSS_MARKOV in table:
            entries = table[GAUSS_MARKOV]
            if not isinstance(entries, list):
                raise self.error(
                    f"{where}.{GAUSS_MARKOV}",
                    f"write [[{where}.{GAUSS_MARKOV}]], with two brackets, once a process",
                )
            out[GAUSS_MARKOV] = tuple(
                self.gauss_markov(entry, sensor, f"{where}.{GAUSS_MARKOV}.{i}")
                for i, entry in enumerate(entries)
            )
            for i, entry in enumerate(entries):
                own = self.errors(
                    entry.get(_ERROR, {}), sensor, f"{where}.{GAUSS_MARKOV}.{i}.{_ERROR}", GM_KEYS
                )
                errors |= {f"{key}_{i + 1}": sigma for key, sigma in own.items()}
        return out | {_ERROR: errors}

    def errors(
        self, table: Any, sensor: str, where: str, keys: tuple[str, ...]
    ) -> dict[str, float]:
        """Standard errors of the quantities `keys`."""
        return {
            key: self.value(text, sensor, key, f"{where}.{key}")
            for key, text in self.checked_table(table, where, keys).items()
        }

    def gauss_markov(self, entry: Any, sensor: str, where: str) -> GaussMarkov:
        self.checked_table(entry, where, (*GM_KEYS, "sigma", _ERROR))
        if "correlation_time" not in entry or ("driving_noise" in entry) == ("sigma" in entry):
            raise self.error(
                where,
                "a Gauss-Markov process takes correlation_time and either driving_noise or sigma",
            )
        time = self.value(
            entry["correlation_time"], sensor, "correlation_time", f"{where}.correlation_time"
        )
        if time == 0.0:
            raise self.error(
                f"{where}.correlation_time", f"{entry['correlation_time']!r} must be positive"
            )
        if "sigma" in entry:
            return GaussMarkov.from_sigma(
                time, self.value(entry["sigma"], sensor, "sigma", f"{where}.sigma")
            )
        return GaussMarkov(
            time,
            self.value(entry["driving_noise"], sensor, "driving_noise", f"{where}.driving_noise"),
        )

    def value(self, text: Any, sensor: str, key: str, where: str) -> float:
        try:
            value = parse_quantity(
                text, "s" if key == "correlation_time" else NOISE_UNITS[sensor][key]
            )
        except InputError as error:
            raise self.error(where, str(error)) from None
        if value < 0.0:
            raise self.error(
                where, f"{text!r} is negative; a standard deviation or root density is expected"
            )
        return value


_HEADER = re.compile(r"\s*(\[\[?)([\w.\s]+)\]")
_KEY = re.compile(r"\s*([\w-]+)\s*=")


def _key_lines(text: str) -> Iterator[tuple[str, int]]:
    """Dotted name and line, from 1, of every table and key; entries of an array of tables are
    numbered from 0.
    """
    table = ""
    count: dict[str, int] = {}
    for number, line in enumerate(lines_of(text), start=1):
        if header := _HEADER.match(line):
            table = "".join(header[2].split())
            if header[1] == "[[":
                count[table] = count.get(table, -1) + 1
                table = f"{table}.{count[table]}"
            yield table, number
        elif key := _KEY.match(line):
            yield (f"{table}.{key[1]}" if table else key[1]), number


def comment_lines(text: str) -> list[str]:
    """A remark as comment lines of a TOML file."""
    return textwrap.wrap(
        text,
        _COMMENT_WIDTH,
        initial_indent="# ",
        subsequent_indent="#   ",
        break_long_words=False,
        break_on_hyphens=False,
    )


def _sensor_lines(sensor: str, axes: tuple[AxisNoise, ...]) -> list[str]:
    """[sensor] with what the three axes share, then [sensor.x] ... with what they do not."""
    names = (*QUANTITIES, GAUSS_MARKOV)
    shared = {
        name
        for name in names
        if len({(getattr(axis, name), _errors_of(axis, name)) for axis in axes}) == 1
    }
    lines = _table_lines(sensor, sensor, axes[0], [name for name in names if name in shared])
    for letter, axis in zip(_AXES, axes, strict=True):
        if own := [name for name in names if name not in shared]:
            lines += _table_lines(sensor, f"{sensor}.{letter}", axis, own)
    return lines


def _errors_of(axis: AxisNoise, name: str) -> tuple[tuple[str, float], ...]:
    """Return the standard errors (name, sigma) of a quantity, or of the Gauss-Markov processes."""
    of_processes = name == GAUSS_MARKOV
    return tuple(
        pair
        for pair in axis.standard_error
        if (pair[0] not in QUANTITIES if of_processes else pair[0] == name)
    )


def _table_lines(sensor: str, table: str, axis: AxisNoise, names: list[str]) -> list[str]:
    units = NOISE_UNITS[sensor] | {"correlation_time": "s"}
    lines = ["", f"[{table}]"]
    plain = [name for name in names if name != GAUSS_MARKOV]
    for name in plain:
        value = getattr(axis, name)
        if value or name == "white_noise":
            lines.append(f'{name} = "{format_quantity(value, units[name])}"')
    lines += _error_line(
        units, {name: sigma for key in plain for name, sigma in _errors_of(axis, key)}
    )
    errors = dict(axis.standard_error)
    for k, process in enumerate(axis.gauss_markov if GAUSS_MARKOV in names else (), start=1):
        lines += [
            f"[[{table}.{GAUSS_MARKOV}]]",
            f'correlation_time = "{format_quantity(process.correlation_time_s, "s")}"',
        ]
        lines += [
            f'driving_noise = "{format_quantity(process.driving_noise, units["driving_noise"])}"'
        ]
        lines += _error_line(
            units, {key: errors[f"{key}_{k}"] for key in GM_KEYS if f"{key}_{k}" in errors}
        )
    return lines


def _error_line(units: dict[str, str], errors: dict[str, float]) -> list[str]:
    inside = ", ".join(
        f'{name} = "{format_quantity(sigma, units[name])}"' for name, sigma in errors.items()
    )
    return [f"{_ERROR} = {{ {inside} }}"] if errors else []


def _toml_text(text: str) -> str:
    """TOML basic string: backslash, quote and control characters escaped."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + re.sub(r"[\x00-\x1f\x7f]", lambda match: f"\\u{ord(match[0]):04x}", escaped) + '"'
