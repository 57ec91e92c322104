"""Published Haar wavelet or Allan variances of an IMU instead of its recording.

The format is data_specs/variances.md.

A JSON file as the R packages of SMAC-Group hold them (class `imu_wvar` or `imu_avar` written out),
or a text table with its rate and length in comment lines. Levels follow from the scales: 2^j
samples long, twice the averaging time of the Allan variance, which is 2 nu.
"""

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError, UsageError
from ....base.files import lines_of
from ....base.received.nesting import parse_json
from ....base.units import LARGEST_UNIT, is_number
from ....base.wording import spell
from ....records import Array, WaveletVariance, chi_square_interval
from ..text.columns import TableSpec
from ..text.layout import decode, is_comment, quote
from ..text.text import Source, TextTable, load_bytes, number, read_text_table
from ..text.units import check_units, unit_factor

Refusal = Callable[[str], InputError]
RowRefusal = Callable[[int, str], InputError]  # of a row of the curve, from 0

SPEC = TableSpec(
    {
        "axis": "axis",
        "scale_s": "scale_s scale",
        "tau_s": "tau_s tau averaging_time_s averaging_time",
        "wavelet_variance": "wavelet_variance wvar",
        "allan_variance": "allan_variance avar",
        "allan_deviation": "allan_deviation deviation adev oadev",
        "variance": "variance",
        "low": "low ci_low",
        "high": "high ci_high",
    },
    text=True,
)
# name in a JSON file, and of the column, of the curves of avar::avar and wv::wvar
JSON_NAMES = {
    "avar": (("levels", "tau_s"), ("allan", "allan_variance")),
    "wvar": (
        *(("scales", "scale_s"), ("variance", "wavelet_variance")),
        *(("ci_low", "low"), ("ci_high", "high")),
    ),
}
STATED = ("rate_hz", "samples", "axis", "sensor", "unit", "gyro_unit", "accel_unit")
_TIMES = ("scale_s", "tau_s")
_VARIANCE_KINDS = ("wavelet_variance", "allan_variance", "allan_deviation")
_EXAMPLE = "as in 'scale_s,wavelet_variance' or 'tau_s,allan_deviation'"
_ROUNDING = 0.01  # relative error of a published scale: tables print two digits or more
_AXIS = re.compile(r"(gyro|accel|acc|g|a)[a-z]*[\s._]*([xyz])", re.IGNORECASE)
# coefficients at a scale: no recording is so long, and a float still counts one by one
MOST_COEFFICIENTS = 1e15
_COMMENT_LINE = re.compile(r"\s*[#%!;/]+\s*(\w+)\s*[=:](.*)")


@dataclass(frozen=True)
class PublishedVariances:
    """Published curves of one sensor.

    Attributes
    ----------
    sensor : str
        Its name, or "".
    curves : mapping
        Curves by axis, "gyro_x" ... "accel_z", those that the file has, in rad/s and m/s^2.
    """

    sensor: str
    curves: Mapping[str, WaveletVariance]


def read_variances(
    path: Source,
    *,
    member: str | None = None,
    units: Mapping[str, str] | None = None,
    rate_hz: float | None = None,
    samples: int | None = None,
) -> PublishedVariances:
    """Read published variances, JSON or text table.

    Parameters
    ----------
    path : path
        The file.
    member : str, optional
        Which of the sensors of a JSON file.
    units : mapping, optional
        Units of `gyro` and `accel`, rad/s and m/s^2 where neither caller nor file says.
    rate_hz, samples
        Of a text table whose comments do not say.

    Returns
    -------
    PublishedVariances
        The curves.

    Raises
    ------
    InputError
        The first thing that is wrong.
    UsageError
        A member that does not exist, or what is no unit.
    """
    check_units(units, ("gyro", "accel"))
    content = decode(bytes(load_bytes(path)))
    if content.lstrip()[:1] in ("{", "["):
        return _read_json(path, content, member, units or {})
    if member is not None:
        raise UsageError(f"{path}: member {member!r} of a text table; only JSON files have members")
    by_caller = {"rate_hz": rate_hz, "samples": samples}
    comments = _comments(content)
    text = {key: str(value) for key, value in by_caller.items() if value is not None}
    for sensor, unit in (units or {}).items():
        text[f"{sensor}_unit"] = unit
    return _read_text(path, comments | {key: (None, value) for key, value in text.items()})


def _read_text(path: Source, stated: Mapping[str, tuple[int | None, str]]) -> PublishedVariances:
    """Read a text table; `stated` holds line and value of `STATED`, of comments or caller."""
    table = read_text_table(path)
    layout, at_header = table.layout, partial(InputError.at_line, path, table.layout.header_line)
    if layout.header_fields is None:
        problem = f"no header; the line before the numbers must name the columns, {_EXAMPLE}"
        raise InputError.at_line(path, layout.first_line, problem)
    index = SPEC.index(table.path, layout)
    time, value = _meaning(index, at_header)
    for key in ("rate_hz", "samples"):
        if key not in stated:
            how = f"write it into a comment before the header, as in '# {key} = 250'"
            raise at_header(f"{key} is not stated; {how}")
    rate, n = (_positive(path, *stated[key], key) for key in ("rate_hz", "samples"))
    names = np.array(_axis_names(table, index, stated))
    data = {key: table.floats(index[key]) for key in (time, value, "low", "high") if key in index}
    curves = {}
    for name in dict.fromkeys(names.tolist()):
        rows = np.flatnonzero(names == name)

        def refuse(k: int, message: str, rows: NDArray[np.int64] = rows) -> InputError:
            return table.error_at(int(rows[k]), message)

        columns = {key: column[rows] for key, column in data.items()}
        factor = _stated_factor(path, name.partition("_")[0], stated)
        curves[name] = _curve(columns, factor, rate, int(n), refuse)
    return PublishedVariances(stated["sensor"][1] if "sensor" in stated else "", curves)


def _axis_names(
    table: TextTable, index: Mapping[str, int], stated: Mapping[str, tuple[int | None, str]]
) -> list[str]:
    """Return the axis of every row."""
    if "axis" in index:
        return [
            _axis_name(name, partial(table.error_at, row))
            for row, name in enumerate(table.strings(index["axis"]))
        ]
    if "axis" in stated:
        line, text = stated["axis"]
        return [_axis_name(text, partial(InputError.at_line, table.path, line))] * len(table.rows)
    message = (
        "axis is not stated; write it into a comment, as in '# axis = gyro_x', or a column axis"
    )
    raise InputError.at_line(table.path, table.layout.header_line, message)


def _meaning(index: dict[str, int], refuse: Refusal) -> tuple[str, str]:
    """Return the names of the column of time and of the column of values.

    "variance" beside scale_s alone is one of wavelets.
    """
    time = [name for name in _TIMES if name in index]
    if "variance" in index and time == ["scale_s"]:
        index["wavelet_variance"] = index.pop("variance")
    if "variance" in index:
        how = "name the column wavelet_variance or allan_variance"
        raise refuse(f"'variance' beside tau_s may be a wavelet or Allan variance; {how}")
    value = [name for name in _VARIANCE_KINDS if name in index]
    if len(time) != 1 or len(value) != 1:
        needed = f"one column of {', '.join(_TIMES)} and one of {', '.join(_VARIANCE_KINDS)}"
        raise refuse(f"the header must name {needed}, {_EXAMPLE}")
    if ("low" in index) != ("high" in index):
        raise refuse("the confidence interval has only one end; give both low and high, or neither")
    return time[0], value[0]


def _wavelet_variance(values: Array, kind: str) -> Array:
    """Return nu of a wavelet variance, of an Allan variance 2 nu or of its root.

    Negative values stay negative.
    """
    if kind == "wavelet_variance":
        return values
    return 0.5 * values if kind == "allan_variance" else 0.5 * values * np.abs(values)


def _comments(text: str) -> dict[str, tuple[int | None, str]]:
    """Return line and value of the comments "# key = value" with one of `STATED`."""
    comments: dict[str, tuple[int | None, str]] = {}
    for number_, line in enumerate(lines_of(text), 1):
        match = _COMMENT_LINE.fullmatch(line) if is_comment(line) else None
        if match and match[1].lower() in STATED:
            comments[match[1].lower()] = (number_, match[2].strip())
    return comments


def _positive(path: Source, line: int | None, text: str, key: str) -> float:
    value = number(text, path, line or 0) if line else float(text)
    if not 0.0 < value < math.inf or (key == "samples" and value % 1.0):
        must = "it must be a whole number," if value > 0.0 else "it must be"
        raise InputError.at_line(path, line, f"{key} {text}; {must} greater than zero")
    return value


def _stated_factor(
    path: Source, sensor: str, stated: Mapping[str, tuple[int | None, str]]
) -> float:
    """Return the factor to rad/s or m/s^2, 1 where no unit is stated."""
    line, unit = stated.get(f"{sensor}_unit") or stated.get("unit") or (None, "")
    try:
        return unit_factor(unit, sensor) if unit else 1.0
    except UsageError as error:
        raise (
            InputError.at_line(path, line, f"unit of {sensor}: {error}") if line else error
        ) from None


def _axis_name(text: str, refuse: Refusal) -> str:
    match = _AXIS.fullmatch(text.strip())
    if match is None:
        raise refuse(
            f"axis {quote(text)} is unknown; write gyro_x, gyro_y, gyro_z, accel_x, accel_y or"
            " accel_z"
        )
    return f"{'gyro' if match[1].lower().startswith('g') else 'accel'}_{match[2].lower()}"


def _curve(
    columns: Mapping[str, Array], factor: float, rate_hz: float, samples: int, refuse: RowRefusal
) -> WaveletVariance:
    """Return the record of columns of one time, one value and its interval, after a check of all.

    Without intervals it has those of `stochastic.wavelet` (W.3). Values times `factor` squared are
    in SI.
    """
    kind = next(name for name in _VARIANCE_KINDS if name in columns)
    scale_s = columns["scale_s"] if "scale_s" in columns else 2.0 * columns["tau_s"]
    nu, low, high = (
        factor**2 * _wavelet_variance(columns[name], kind) if name in columns else None
        for name in (kind, "low", "high")
    )
    assert nu is not None
    exact = np.log2(np.maximum(scale_s * rate_hz, 1e-300))
    level = np.rint(exact).astype(np.int64)
    count = samples - 2.0**level + 1
    for k, s in enumerate(scale_s):
        problem = ""
        if level[k] < 1 or abs(exact[k] - level[k]) > _ROUNDING / math.log(2.0):
            of_samples = f"is {s * rate_hz:g} samples of {rate_hz:g} Hz"
            problem = f"{of_samples}; only scales of 2, 4, 8, 16, ... samples can be fitted"
        elif k and level[k] <= level[k - 1]:
            problem = f"follows {scale_s[k - 1]:g} s; scales must increase, each once"
        elif count[k] < 1:
            problem = f"is longer than {samples} samples at {rate_hz:g} Hz are; correct these"
        elif nu[k] <= 0.0:
            raise refuse(k, f"variance {nu[k]:g} at scale {s:g} s; it must be greater than zero")
        elif low is not None and high is not None and not 0.0 < low[k] < nu[k] < high[k]:
            interval = f"the confidence interval at scale {s:g} s does not contain the variance"
            raise refuse(k, f"{interval}, or its lower limit is not above zero; correct its limits")
        if problem:
            raise refuse(k, f"scale {s:g} s {problem}")
    if not (np.abs(count) < MOST_COEFFICIENTS).all():
        raise refuse(0, f"{count.max():g} coefficients at a scale; correct the number of samples")
    if low is None or high is None:
        low, high = chi_square_interval(nu, np.maximum(count / 2.0**level, 1.0))
    return WaveletVariance(level, nu, low, high, count.astype(np.int64), rate_hz, samples)


def _read_json(
    path: Source, text: str, member: str | None, units: Mapping[str, str]
) -> PublishedVariances:
    content, name = _member(path, parse_json(path, text), member)

    prefix = f"{name}: " if name else ""

    def refuse(message: str) -> InputError:
        return InputError.in_file(path, prefix + message)

    kind_of_curves = "avar" if "avar" in content else "wvar"
    named = content[kind_of_curves]
    kinds, letters = (_strings(content.get(key), key, refuse) for key in ("type", "axis"))
    if not isinstance(named, dict) or not len(named) == len(kinds) == len(letters) > 0:
        raise refuse(f"{kind_of_curves}, type and axis must name the same axes, one or more")
    rate, n = (float(_numbers(content.get(key), key, refuse)[0]) for key in ("freq", "n"))
    if not (rate > 0.0 and n >= 4.0 and n % 1.0 == 0.0):
        expected = "freq must be a rate in Hz, n a number of samples of 4 or more"
        raise refuse(f"freq {rate:g} and n {n:g}; {expected}")
    curves = {}
    for (label, curve), kind, letter in zip(named.items(), kinds, letters, strict=True):

        def refuse_curve(message: str, label: str = label) -> InputError:
            return refuse(f"{label}: {message}")

        axis = _axis_name(f"{kind} {letter}", refuse)
        if axis in curves or not isinstance(curve, dict):
            raise refuse_curve(f"{axis} occurs twice, or its curve is no JSON object")
        sensor = axis.partition("_")[0]
        factor = unit_factor(units[sensor], sensor) if sensor in units else 1.0
        columns = _json_columns(curve, kind_of_curves, refuse_curve)
        curves[axis] = _curve(
            columns, factor, rate, int(n), lambda _, message: refuse_curve(message)
        )
    sensor_name = content.get("sensor")
    return PublishedVariances(
        _strings(sensor_name, "sensor", refuse)[0] if sensor_name else name, curves
    )


def _member(path: Source, tree: Any, member: str | None) -> tuple[dict[str, Any], str]:
    """Return the object that holds wvar or avar, and the name of the member it belongs to."""
    name, content = "", tree
    while isinstance(content, dict) and "wvar" not in content and "avar" not in content:
        if member in content:
            name, member = str(member), None
        elif len(content) == 1 and (member is None or not name):
            name = next(iter(content))
        else:
            members = ", ".join(content)
            raise UsageError(
                f"{path}: {f'no member {member!r}' if member else 'several members'}; set"
                f" {spell('member')} to one of {members}"
            )
        content = content[name]
    if not isinstance(content, dict):
        raise InputError.in_file(
            path,
            "an object with wvar or avar, freq, n, type and axis is expected, as wv::wvar and"
            " avar::avar return it",
        )
    if member is not None and name != member:
        raise UsageError(
            f"{path}: no member {member!r}; leave {spell('member')} out, the file has one sensor"
        )
    return content, name


def _json_columns(curve: dict[str, Any], kind: str, refuse: Refusal) -> dict[str, Array]:
    """Return the columns of a curve of wv::wvar or of avar::avar, whose levels are times."""
    for key, expected in (("decomp", "modwt"), ("filter", "haar"), ("type", "mo")):
        if key in curve and (actual := _strings(curve[key], key, refuse)[0]) != expected:
            raise refuse(f"{key} {actual!r}; only {expected!r} (overlapping, Haar) can be fitted")
    columns = {name: _numbers(curve.get(key), key, refuse) for key, name in JSON_NAMES[kind]}
    if len({column.size for column in columns.values()}) != 1:
        keys = ", ".join(key for key, _ in JSON_NAMES[kind])
        sizes = ", ".join(str(column.size) for column in columns.values())
        raise refuse(f"{keys} have {sizes} values; all must have equally many")
    if kind == "avar" or "alpha" not in curve:
        return columns
    if (alpha := float(_numbers(curve["alpha"], "alpha", refuse)[0])) != 0.05:
        of_others = f"confidence intervals of {100 * (1 - alpha):g} %"
        raise refuse(f"{of_others}; those of 95 % (alpha 0.05) are expected")
    return columns


def _numbers(value: Any, key: str, refuse: Refusal) -> Array:
    """Return finite numbers (k,), k > 0, of a JSON number, list or list of lists of one."""
    rows = value if isinstance(value, list) else [value]
    flat = [item for row in rows for item in (row if isinstance(row, list) else [row])]
    numbers = np.array(
        [float(x) if is_number(x) and abs(x) < LARGEST_UNIT else np.nan for x in flat]
    )
    if numbers.size == 0 or not np.isfinite(numbers).all():
        raise refuse(f"{key} {quote(json.dumps(value))}; finite numbers are expected")
    return numbers


def _strings(value: Any, key: str, refuse: Refusal) -> list[str]:
    """Return the texts of a JSON text or list of texts, one or more."""
    texts = [value] if isinstance(value, str) else value
    if not isinstance(texts, list) or not texts or not all(isinstance(text, str) for text in texts):
        raise refuse(f"{key} {quote(json.dumps(value))}; text is expected")
    return texts
