"""The noise model of an IMU, and its file.

Each axis is a sum of named processes, for a gyroscope in X = rad/s and for an accelerometer in X = m/s^2:

    turn_on_bias    X              standard deviation of a constant
    white_noise     X/sqrt(Hz)     root power spectral density (angle or velocity random walk, X sqrt(s))
    quantization    X s            standard deviation of white rounding error on the cumulated angle or velocity (step / sqrt(12))
    random_walk     X/s/sqrt(Hz)   root power spectral density of the driving white noise
    drift           X/s            standard deviation of a constant slope
    gauss_markov    de/dt = -e/T + xi, root power spectral density of xi in X/s/sqrt(Hz)
    scale_factor    1              standard deviation; used where the filter estimates it
    misalignment    rad            the same

White noise of root density q integrates to a variance of q^2 dt over dt (footnote 7 of paper 000).
The file is TOML as in `data_specs` (noise model); [gyro.x] overrides single quantities of [gyro] for that axis.
"""

import contextlib
import difflib
import math
import os
import re
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from ..errors import InputError, UsageError
from ..units import format_quantity, parse_quantity

MODELS = Path(__file__).parent / "models"
_AXES = ("x", "y", "z")
_GM = "gauss_markov"

# unit of each quantity: the dimension that a file's value must have, and the unit in which one is written
_UNITS: dict[str, dict[str, str]] = {
    "gyro": {
        "turn_on_bias": "deg/h",
        "white_noise": "deg/h/sqrt(Hz)",
        "quantization": "urad",
        "random_walk": "deg/s^2/sqrt(Hz)",
        "drift": "deg/h/s",
        "scale_factor": "ppm",
        "misalignment": "mrad",
        "driving_noise": "deg/s^2/sqrt(Hz)",
        "sigma": "deg/h",
    },
    "accel": {
        "turn_on_bias": "mg",
        "white_noise": "ug/sqrt(Hz)",
        "quantization": "m/s",
        "random_walk": "ug/s/sqrt(Hz)",
        "drift": "ug/s",
        "scale_factor": "ppm",
        "misalignment": "mrad",
        "driving_noise": "ug/s/sqrt(Hz)",
        "sigma": "ug",
    },
}
_QUANTITIES = ("turn_on_bias", "white_noise", "quantization", "random_walk", "drift", "scale_factor", "misalignment")
_GM_KEYS = ("correlation_time", "driving_noise", "sigma")


@dataclass(frozen=True)
class GaussMarkov:
    """First-order Gauss-Markov process de/dt = -e/T + xi, xi white of root density `driving_noise`, X/s/sqrt(Hz)."""

    correlation_time_s: float
    driving_noise: float

    def __post_init__(self) -> None:
        if not (0.0 < self.correlation_time_s < math.inf):
            raise InputError(f"correlation_time {self.correlation_time_s:g} s must be positive and finite; a random_walk has none")
        if not (0.0 <= self.driving_noise < math.inf):
            raise InputError(f"driving_noise {self.driving_noise:g} of a Gauss-Markov process must be finite and not negative")

    @classmethod
    def from_sigma(cls, correlation_time_s: float, sigma: float) -> "GaussMarkov":
        """Process of the stationary standard deviation `sigma`, X."""
        return cls(correlation_time_s, sigma * math.sqrt(2.0 / correlation_time_s) if correlation_time_s > 0.0 else math.nan)

    @property
    def sigma(self) -> float:
        """Stationary standard deviation, X."""
        return self.driving_noise * math.sqrt(0.5 * self.correlation_time_s)


@dataclass(frozen=True)
class AxisNoise:
    """Processes of one axis in SI, X = rad/s or m/s^2; zero means absent."""

    white_noise: float = 0.0
    quantization: float = 0.0
    turn_on_bias: float = 0.0
    random_walk: float = 0.0
    drift: float = 0.0
    gauss_markov: tuple[GaussMarkov, ...] = ()
    scale_factor: float = 0.0
    misalignment: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, _GM, tuple(self.gauss_markov))
        for name in _QUANTITIES:
            value = getattr(self, name)
            if not (0.0 <= value < math.inf):
                raise InputError(f"{name} {value:g} must be finite and not negative")


@dataclass(frozen=True)
class NoiseModel:
    """Noise of three gyroscopes and three accelerometers, in the order of the sensor's x, y, z."""

    name: str
    source: str
    gyro: tuple[AxisNoise, AxisNoise, AxisNoise]
    accel: tuple[AxisNoise, AxisNoise, AxisNoise]

    def __post_init__(self) -> None:
        for sensor in ("gyro", "accel"):
            axes = tuple(getattr(self, sensor))
            if len(axes) != 3:
                raise InputError(f"noise model {self.name!r}: {len(axes)} {sensor} axes, expected 3")
            object.__setattr__(self, sensor, axes)


def shipped_models() -> tuple[str, ...]:
    """Names of the noise models that the package brings along."""
    return tuple(sorted(path.stem for path in MODELS.glob("*.toml")))


def weighted_model(models: Sequence[NoiseModel], weights: Sequence[tuple[float, float]]) -> NoiseModel:
    """Noise of the weighted mean of several IMUs, whose errors are independent.

    weights : share of each in gyro and accelerometer. Every density and sigma q_j becomes sqrt(sum (weight q_j)^2); Gauss-Markov processes
    are added up where all models have the same correlation times, and stand side by side where not.
    """

    def triad(sensor: str, k: int) -> tuple[AxisNoise, AxisNoise, AxisNoise]:
        share = [weight[k] for weight in weights]
        x, y, z = (_weighted_axis([getattr(model, sensor)[c] for model in models], share) for c in range(3))
        return x, y, z

    name, source = (" + ".join(dict.fromkeys(getattr(model, f) for model in models)) for f in ("name", "source"))
    return NoiseModel(name, source, triad("gyro", 0), triad("accel", 1))


def _weighted_axis(axes: list[AxisNoise], w: list[float]) -> AxisNoise:
    plain = {name: math.hypot(*(w_j * getattr(axis, name) for axis, w_j in zip(axes, w, strict=True))) for name in _QUANTITIES}
    times = [tuple(gm.correlation_time_s for gm in axis.gauss_markov) for axis in axes]
    scaled = [
        [GaussMarkov(gm.correlation_time_s, abs(w_j) * gm.driving_noise) for gm in axis.gauss_markov]
        for axis, w_j in zip(axes, w, strict=True)
    ]
    if len(set(times)) == 1:
        processes = tuple(GaussMarkov(T, math.hypot(*(own[i].driving_noise for own in scaled))) for i, T in enumerate(times[0]))
    else:
        processes = tuple(gm for own in scaled for gm in own if gm.driving_noise > 0.0)
    return AxisNoise(gauss_markov=processes, **plain)


def load_noise_model(name_or_path: str | os.PathLike[str]) -> NoiseModel:
    """Noise model of a shipped name, such as "navchip", or of a file.

    Raises InputError, with file and line, for a file that is missing or no TOML, an unknown key or table (naming the
    nearest), and a quantity that is negative, without unit or of another dimension.
    """
    shipped = shipped_models()
    name = os.fspath(name_or_path)
    path = MODELS / f"{name}.toml" if name in shipped else Path(name)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        why = "not UTF-8 text" if isinstance(error, UnicodeDecodeError) else (error.strerror or str(error)).lower()
        raise InputError(f"{name}: {why}; give a noise-model file or one of the shipped {', '.join(shipped)}") from None
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError.at(path, None, f"not TOML: {error}") from None
    return _Reader(path, text).model(tree)


@dataclass
class _Reader:
    """The tree of one file to a model; knows where in the file it stands."""

    path: Path
    text: str
    lines: dict[str, int] = field(init=False)

    def __post_init__(self) -> None:
        self.lines = dict(_key_lines(self.text))

    def error(self, where: str, what: str) -> InputError:
        """Error at the line of `where`, or of the table around it where the file does not name it."""
        place = where
        while place and place not in self.lines:
            place = place.rpartition(".")[0]
        return InputError.at(self.path, self.lines.get(place), f"{where}: {what}")

    def known(self, table: Any, where: str, keys: tuple[str, ...]) -> dict[str, Any]:
        """`table` when it is one and has no key but `keys`."""
        if not isinstance(table, dict):
            raise self.error(where, f"{table!r} stands where a table [{where}] is expected")
        for key in table:
            if key not in keys:
                near = difflib.get_close_matches(key, keys, n=1, cutoff=0.0)
                raise self.error(f"{where}.{key}" if where else key, f"unknown key; the nearest known is {near[0]!r}")
        return table

    def model(self, tree: dict[str, Any]) -> NoiseModel:
        self.known(tree, "", ("name", "source", "gyro", "accel"))
        for key in ("name", "source"):
            if not isinstance(tree.get(key, ""), str):
                raise self.error(key, f"{tree[key]!r} is not text; put it in quotes")
        gyro, accel = (self.sensor(tree, sensor) for sensor in ("gyro", "accel"))
        return NoiseModel(tree.get("name", self.path.stem), tree.get("source", str(self.path)), gyro, accel)

    def sensor(self, tree: dict[str, Any], sensor: str) -> tuple[AxisNoise, AxisNoise, AxisNoise]:
        if sensor not in tree:
            raise InputError.at(self.path, None, f"table [{sensor}] is missing; it needs at least white_noise")
        table = self.known(tree[sensor], sensor, (*_QUANTITIES, _GM, *_AXES))
        common = self.quantities({key: value for key, value in table.items() if key not in _AXES}, sensor, sensor)
        x, y, z = (self.axis(table.get(axis, {}), common, sensor, axis) for axis in _AXES)
        return x, y, z

    def axis(self, table: Any, common: dict[str, Any], sensor: str, axis: str) -> AxisNoise:
        where = f"{sensor}.{axis}"
        own = self.quantities(self.known(table, where, (*_QUANTITIES, _GM)), sensor, where)
        merged = {**common, **own}
        if "white_noise" not in merged:
            raise self.error(where, f"white_noise is missing; give it in [{sensor}], as in '1 {_UNITS[sensor]['white_noise']}'")
        return AxisNoise(**merged)

    def quantities(self, table: dict[str, Any], sensor: str, where: str) -> dict[str, Any]:
        """The keyword arguments of `AxisNoise` that `table` holds."""
        out: dict[str, Any] = {key: self.value(table[key], sensor, key, f"{where}.{key}") for key in table if key != _GM}
        if _GM in table:
            entries = table[_GM]
            if not isinstance(entries, list):
                raise self.error(f"{where}.{_GM}", f"write [[{where}.{_GM}]], with two brackets, once a process")
            out[_GM] = tuple(self.gauss_markov(entry, sensor, f"{where}.{_GM}.{i}") for i, entry in enumerate(entries))
        return out

    def gauss_markov(self, entry: Any, sensor: str, where: str) -> GaussMarkov:
        self.known(entry, where, _GM_KEYS)
        if "correlation_time" not in entry or ("driving_noise" in entry) == ("sigma" in entry):
            raise self.error(where, "a Gauss-Markov process takes correlation_time and either driving_noise or sigma")
        time = self.value(entry["correlation_time"], sensor, "correlation_time", f"{where}.correlation_time")
        if time == 0.0:
            raise self.error(f"{where}.correlation_time", f"{entry['correlation_time']!r} must be positive")
        if "sigma" in entry:
            return GaussMarkov.from_sigma(time, self.value(entry["sigma"], sensor, "sigma", f"{where}.sigma"))
        return GaussMarkov(time, self.value(entry["driving_noise"], sensor, "driving_noise", f"{where}.driving_noise"))

    def value(self, text: Any, sensor: str, key: str, where: str) -> float:
        try:
            value = parse_quantity(text, "s" if key == "correlation_time" else _UNITS[sensor][key])
        except InputError as error:
            raise self.error(where, str(error)) from None
        if value < 0.0:
            raise self.error(where, f"{text!r} is negative; a standard deviation or root density is expected")
        return value


_HEADER = re.compile(r"\s*(\[\[?)\s*([\w.\s]+?)\s*\]")
_KEY = re.compile(r"\s*([\w-]+)\s*=")


def _key_lines(text: str) -> Iterator[tuple[str, int]]:
    """Dotted name and line, from 1, of every table and key; entries of an array of tables are numbered from 0."""
    table = ""
    count: dict[str, int] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _HEADER.match(line):
            table = header[2].replace(" ", "")
            if header[1] == "[[":
                count[table] = count.get(table, -1) + 1
                table = f"{table}.{count[table]}"
            yield table, number
        elif key := _KEY.match(line):
            yield (f"{table}.{key[1]}" if table else key[1]), number


def write_noise_model(model: NoiseModel, path: str | os.PathLike[str]) -> None:
    """Write `model` as a noise-model file that `load_noise_model` turns back into the same model; whole or not at all.

    Raises UsageError where the path cannot be written.
    """
    lines = [f"name = {_toml_text(model.name)}", f"source = {_toml_text(model.source)}"]
    for sensor in ("gyro", "accel"):
        lines += _sensor_lines(sensor, getattr(model, sensor))
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
        os.replace(temporary, path)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written, {(error.strerror or str(error)).lower()}; give another path") from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def _sensor_lines(sensor: str, axes: tuple[AxisNoise, ...]) -> list[str]:
    """[sensor] with what the three axes share, then [sensor.x] ... with what they do not."""
    names = [f.name for f in fields(AxisNoise)]
    shared = {name for name in names if len({getattr(axis, name) for axis in axes}) == 1}
    lines = _table_lines(sensor, sensor, axes[0], [name for name in names if name in shared])
    for letter, axis in zip(_AXES, axes, strict=True):
        if own := [name for name in names if name not in shared]:
            lines += _table_lines(sensor, f"{sensor}.{letter}", axis, own)
    return lines


def _table_lines(sensor: str, table: str, axis: AxisNoise, names: list[str]) -> list[str]:
    units = _UNITS[sensor]
    lines = ["", f"[{table}]"]
    for name in names:
        value = getattr(axis, name)
        if name != _GM and (value or name == "white_noise"):
            lines.append(f'{name} = "{format_quantity(value, units[name])}"')
    for process in axis.gauss_markov if _GM in names else ():
        lines += [f"[[{table}.{_GM}]]", f'correlation_time = "{format_quantity(process.correlation_time_s, "s")}"']
        lines += [f'driving_noise = "{format_quantity(process.driving_noise, units["driving_noise"])}"']
    return lines


def _toml_text(text: str) -> str:
    """TOML basic string: backslash, quote and control characters escaped."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + re.sub(r"[\x00-\x1f\x7f]", lambda match: f"\\u{ord(match[0]):04x}", escaped) + '"'
