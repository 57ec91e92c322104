"""The noise model of an IMU, and its file.

Each axis is a sum of named processes, for a gyroscope in X = rad/s and for an accelerometer in X =
m/s^2:

    turn_on_bias    X              standard deviation of a constant
    white_noise     X/sqrt(Hz)     root power spectral density (angle or velocity random walk, X
                                   sqrt(s))
    quantization    X s            standard deviation of white rounding error on the cumulated angle
                                   or velocity (step / sqrt(12))
    random_walk     X/s/sqrt(Hz)   root power spectral density of the driving white noise
    drift           X/s            standard deviation of a constant slope
    gauss_markov    de/dt = -e/T + xi, root power spectral density of xi in X/s/sqrt(Hz)
    scale_factor    1              standard deviation; used where the filter estimates it
    misalignment    rad            the same

White noise of root density q integrates to a variance of q^2 dt over dt (footnote 7 of paper 000).
The file is TOML as in `data_specs` (noise model); [gyro.x] overrides single quantities of [gyro]
for that axis. A model that was estimated says of which recordings, and how well each quantity is
known. What is shared by the three axes stands in [gyro] or [accel], what differs in [gyro.x] ...; a
`standard_error` table stands beside the quantities that it is of.
"""

import math
import os
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...base.errors import InputError
from ...base.files import atomic_write
from ...base.inputs import read_text
from ...base.tables import OptionTable, table_of_text
from ...base.units import format_quantity
from ...base.wording import toml
from .noise_model import (
    GAUSS_MARKOV,
    GM_KEYS,
    NOISE_QUANTITIES,
    NOISE_UNITS,
    AxisNoise,
    GaussMarkov,
    NoiseModel,
    RecordingSource,
)

__all__ = [
    "GAUSS_MARKOV",
    "GM_KEYS",
    "NOISE_QUANTITIES",
    "NOISE_UNITS",
    "AxisNoise",
    "GaussMarkov",
    "NoiseModel",
    "RecordingSource",
    "comment_lines",
    "load_noise_model",
    "model_of_text",
    "shipped_models",
    "text_of_model",
    "weighted_model",
    "write_noise_model",
]

MODELS_DIRECTORY = Path(__file__).parent / "models"
_AXES = ("x", "y", "z")
_ERROR = "standard_error"
_COMMENT_WIDTH = 118  # characters of a line of comment (chosen)


def shipped_models() -> tuple[str, ...]:
    """Names of the noise models that the package brings along."""
    return tuple(sorted(path.stem for path in MODELS_DIRECTORY.glob("*.toml")))


def weighted_model(
    models: Sequence[NoiseModel], weights: Sequence[tuple[float, float]]
) -> NoiseModel:
    """Noise of the weighted mean of several IMUs, whose errors are independent.

    weights : share of each in gyro and accelerometer. Every density and sigma q_j becomes sqrt(sum
        (weight q_j)^2); Gauss-Markov processes
    are added up where all models have the same correlation times, and stand side by side where not.
    """

    def triad(sensor: str, k: int) -> tuple[AxisNoise, AxisNoise, AxisNoise]:
        share = [weight[k] for weight in weights]
        x, y, z = (
            _weighted_axis([getattr(model, sensor)[c] for model in models], share) for c in range(3)
        )
        return x, y, z

    name, source = (
        " + ".join(dict.fromkeys(getattr(model, f) for model in models)) for f in ("name", "source")
    )
    recordings = dict.fromkeys(recording for model in models for recording in model.recordings)
    misfit = dict.fromkeys(sentence for model in models for sentence in model.misfit)
    return NoiseModel(
        name, source, triad("gyro", 0), triad("accel", 1), tuple(recordings), tuple(misfit)
    )


def _weighted_axis(axes: list[AxisNoise], w: list[float]) -> AxisNoise:
    plain: dict[str, Any] = {
        name: math.hypot(*(w_j * getattr(axis, name) for axis, w_j in zip(axes, w, strict=True)))
        for name in NOISE_QUANTITIES
    }
    times = [tuple(gm.correlation_time_s for gm in axis.gauss_markov) for axis in axes]
    scaled = [
        [
            GaussMarkov(gm.correlation_time_s, abs(w_j) * gm.driving_noise)
            for gm in axis.gauss_markov
        ]
        for axis, w_j in zip(axes, w, strict=True)
    ]
    if len(set(times)) == 1:
        processes = tuple(
            GaussMarkov(T, math.hypot(*(own[i].driving_noise for own in scaled)))
            for i, T in enumerate(times[0])
        )
    else:
        processes = tuple(gm for own in scaled for gm in own if gm.driving_noise > 0.0)
    return AxisNoise(gauss_markov=processes, **plain)


def load_noise_model(name_or_path: str | os.PathLike[str] | NoiseModel) -> NoiseModel:
    """Return the noise model of a shipped name, such as "navchip", or of a file.

    Parameters
    ----------
    name_or_path : name, path, or a model, which is returned as it is.

    Returns
    -------
    The model.

    Raises
    ------
    InputError : with file and line, for a file that is missing or no TOML, an unknown key or table
        (naming the nearest), and a quantity that is negative, without unit or of another dimension.
    """
    if isinstance(name_or_path, NoiseModel):
        return name_or_path
    shipped = shipped_models()
    name = os.fspath(name_or_path)
    path = MODELS_DIRECTORY / f"{name}.toml" if name in shipped else Path(name)
    try:
        text = read_text(path, "utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = "not UTF-8 text"
        if isinstance(error, OSError):
            why = (error.strerror or str(error)).lower()
        raise InputError(
            f"{name}: {why}; give a noise-model file or one of the shipped {', '.join(shipped)}"
        ) from None
    return model_of_text(path, text)


def write_noise_model(
    model: NoiseModel, path: str | os.PathLike[str], remarks: Sequence[str] = ()
) -> None:
    """Write a noise-model file, whole or not at all.

    `load_noise_model` turns it back into the same model.

    Parameters
    ----------
    model : NoiseModel
        The model.
    path : path-like
        The file.
    remarks : sequence of str
        Sentences that stand above it as comments.

    Raises
    ------
    UsageError
        Where the path cannot be written.
    """
    atomic_write(path, text_of_model(model, remarks))


def _keys_of_axes(table: str) -> dict[str, tuple[str, ...]]:
    """Return the keys of a table of quantities, [gyro] or [gyro.x], and of those within it."""
    processes = f"{table}.{GAUSS_MARKOV}"
    return {
        table: (*NOISE_QUANTITIES, GAUSS_MARKOV, _ERROR, *(() if "." in table else _AXES)),
        f"{table}.{_ERROR}": NOISE_QUANTITIES,
        processes: (*GM_KEYS, "sigma", _ERROR),
        f"{processes}.{_ERROR}": GM_KEYS,
    }


KEYS: Mapping[str, tuple[str, ...]] = {
    "": ("name", "source", "misfit", "recording", *NOISE_UNITS),
    "recording": ("file", "sha256", "samples", "sampling_rate"),
    **{
        table: keys
        for sensor in NOISE_UNITS
        for own in (sensor, *(f"{sensor}.{axis}" for axis in _AXES))
        for table, keys in _keys_of_axes(own).items()
    },
}


def model_of_text(path: Path, text: str) -> NoiseModel:
    """Model of the text of the file `path`. Raises InputError, with file and line, for what is no
    noise model.
    """
    top = table_of_text(path, text, KEYS)
    top.check_keys()
    gyro, accel = (_sensor(top, sensor) for sensor in NOISE_UNITS)
    recordings = tuple(
        RecordingSource(
            entry.text("file"),
            entry.text("sha256"),
            entry.value("samples", int, ...),
            entry.quantity("sampling_rate", "Hz"),
        )
        for entry in top.tables("recording")
    )
    name, source = top.value("name", str, path.stem), top.value("source", str, str(path))
    return NoiseModel(name, source, gyro, accel, recordings, top.texts("misfit", ()))


def _sensor(top: OptionTable, sensor: str) -> tuple[AxisNoise, AxisNoise, AxisNoise]:
    if sensor not in top.data:
        raise top.error(sensor, f"table [{sensor}] is missing; it needs at least white_noise")
    table = top.table(sensor)
    common = _quantities(table, NOISE_UNITS[sensor])
    x, y, z = (_axis(table.table(axis), common, NOISE_UNITS[sensor]) for axis in _AXES)
    return x, y, z


def _axis(table: OptionTable, common: Mapping[str, Any], units: Mapping[str, str]) -> AxisNoise:
    """Return the noise of one axis, which has the quantities of its sensor but for its own."""
    replaced = _quantities(table, units)
    inherited = {
        name: sigma
        for name, sigma in common[_ERROR].items()
        if (name if name in NOISE_QUANTITIES else GAUSS_MARKOV) not in replaced
    }
    merged = {**common, **replaced, _ERROR: inherited | replaced[_ERROR]}
    if "white_noise" not in merged:
        sensor = table.name.partition(".")[0]
        example = f"'1 {units['white_noise']}'"
        raise table.error("", f"white_noise is missing; give it in [{sensor}], as in {example}")
    try:
        return AxisNoise(**merged)
    except InputError as error:
        raise table.error("", str(error)) from None


def _quantities(table: OptionTable, units: Mapping[str, str]) -> dict[str, Any]:
    """Return the keyword arguments of `AxisNoise` that a table holds."""
    out: dict[str, Any] = _amounts(table, NOISE_QUANTITIES, units)
    errors = _amounts(table.table(_ERROR), NOISE_QUANTITIES, units)
    if GAUSS_MARKOV in table.data:
        entries = table.tables(GAUSS_MARKOV)
        out[GAUSS_MARKOV] = tuple(_gauss_markov(entry, units) for entry in entries)
        for k, entry in enumerate(entries, start=1):
            of_process = _amounts(entry.table(_ERROR), GM_KEYS, units)
            errors |= {f"{key}_{k}": sigma for key, sigma in of_process.items()}
    return out | {_ERROR: errors}


def _gauss_markov(entry: OptionTable, units: Mapping[str, str]) -> GaussMarkov:
    amounts = _amounts(entry, (*GM_KEYS, "sigma"), units)
    time_s = amounts.get("correlation_time")
    if time_s is None or ("driving_noise" in amounts) == ("sigma" in amounts):
        problem = "a Gauss-Markov process takes correlation_time and either driving_noise or sigma"
        raise entry.error("", problem)
    if time_s == 0.0:
        text = entry.data["correlation_time"]
        raise entry.error("correlation_time", f"{text!r} must be positive")
    if "sigma" in amounts:
        return GaussMarkov.from_sigma(time_s, amounts["sigma"])
    return GaussMarkov(time_s, amounts["driving_noise"])


def _amounts(table: OptionTable, keys: Sequence[str], units: Mapping[str, str]) -> dict[str, float]:
    """Return those of the keys that a table holds, in SI; none may be negative."""
    amounts = {key: table.quantity(key, units[key]) for key in keys if key in table.data}
    for key, value in amounts.items():
        if value < 0.0:
            problem = "is negative; a standard deviation or root density is expected"
            raise table.error(key, f"{table.data[key]!r} {problem}")
    return amounts


def text_of_model(model: NoiseModel, remarks: Sequence[str] = ()) -> str:
    """Text of a file that `model_of_text` turns back into the same model; the remarks stand above
    as comments.
    """
    lines = [line for remark in remarks for line in comment_lines(remark)]
    lines += [f"name = {toml(model.name)}", f"source = {toml(model.source)}"]
    if model.misfit:
        lines.append(f"misfit = {toml(model.misfit, width=0)}")
    for recording in model.recordings:
        rate = format_quantity(recording.sampling_rate_hz, "Hz")
        lines += [
            "",
            "[[recording]]",
            f"file = {toml(recording.file)}",
            f"sha256 = {toml(recording.sha256)}",
            f"samples = {recording.samples}",
            f"sampling_rate = {toml(rate)}",
        ]
    for sensor in ("gyro", "accel"):
        lines += _sensor_lines(sensor, getattr(model, sensor))
    return "\n".join(lines) + "\n"


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
    names = (*NOISE_QUANTITIES, GAUSS_MARKOV)
    shared = {
        name
        for name in names
        if len({(getattr(axis, name), _errors_of(axis, name)) for axis in axes}) == 1
    }
    lines = _table_lines(sensor, sensor, axes[0], [name for name in names if name in shared])
    for letter, axis in zip(_AXES, axes, strict=True):
        if single := [name for name in names if name not in shared]:
            lines += _table_lines(sensor, f"{sensor}.{letter}", axis, single)
    return lines


def _errors_of(axis: AxisNoise, name: str) -> tuple[tuple[str, float], ...]:
    """Return the standard errors (name, sigma) of a quantity, or of the Gauss-Markov processes."""
    of_processes = name == GAUSS_MARKOV
    return tuple(
        pair
        for pair in axis.standard_error
        if (pair[0] not in NOISE_QUANTITIES if of_processes else pair[0] == name)
    )


def _table_lines(sensor: str, table: str, axis: AxisNoise, names: list[str]) -> list[str]:
    units = NOISE_UNITS[sensor]
    plain = [name for name in names if name != GAUSS_MARKOV]
    amounts = {name: getattr(axis, name) for name in plain}
    present = {name: x for name, x in amounts.items() if x or name == "white_noise"}
    errors = {name: sigma for key in plain for name, sigma in _errors_of(axis, key)}
    lines = ["", f"[{table}]", *_amount_lines(present, errors, units)]
    errors = dict(axis.standard_error)
    for k, process in enumerate(axis.gauss_markov if GAUSS_MARKOV in names else (), start=1):
        amounts = dict(
            zip(GM_KEYS, (process.correlation_time_s, process.driving_noise), strict=True)
        )
        of_process = {key: errors[f"{key}_{k}"] for key in GM_KEYS if f"{key}_{k}" in errors}
        lines += [f"[[{table}.{GAUSS_MARKOV}]]", *_amount_lines(amounts, of_process, units)]
    return lines


def _amount_lines(
    amounts: Mapping[str, float], errors: Mapping[str, float], units: Mapping[str, str]
) -> list[str]:
    """Return lines of quantities with their units, and of their standard errors."""
    texts, sigmas = (
        {name: format_quantity(value, units[name]) for name, value in values.items()}
        for values in (amounts, errors)
    )
    lines = [f"{name} = {toml(text)}" for name, text in texts.items()]
    return [*lines, f"{_ERROR} = {toml(sigmas)}"] if errors else lines
