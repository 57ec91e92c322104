"""What every record checks at its birth."""

import sys
from collections.abc import Mapping
from datetime import date, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError

Array = NDArray[np.float64]


FINEST_DIGIT = 1e-3
"""What numbers of any unit must be held to: stamps to a millisecond, heights to a millimetre."""


def float_array(who: str, value: Any, finest: float = FINEST_DIGIT) -> Array:
    """Return `value` as an array of float64; InputError where it holds other things than numbers.

    Dates are refused: numpy would turn them into counts of their unit since 1970, of a scale that
    nobody states. So are masked values, whose mask float64 arrays have not, and numbers of fewer
    digits that hold the largest of them to `finest` only: a time of week in float32 is off by up to
    30 ms.

    A `Rotation` of scipy is its matrix.

    who : what the message calls it.
    """
    value = value.as_matrix() if hasattr(value, "as_matrix") else value
    try:
        array = value if hasattr(value, "dtype") else np.asarray(value)
        _refuse_times(who, array)
        _refuse_masked(who, array)
        _refuse_coarse(who, array, finest)
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        shown = " ".join(f"{value!r}".split())[:60]
        raise InputError.of_value(who, f"{shown} is no array of numbers") from None


def _refuse_masked(who: str, values: Any) -> None:
    """Refuse masked values: what stands below a mask is no measurement."""
    ma = sys.modules.get("numpy.ma")  # without it nobody made a masked array
    mask = ma.getmaskarray(values) if ma and isinstance(values, ma.MaskedArray) else None
    if mask is not None and mask.any():
        row = int(np.argwhere(mask)[0][0])
        raise InputError.of_value(
            who,
            f"{np.count_nonzero(mask)} masked values, the first in row {row}; leave these rows out",
        )


def _refuse_coarse(who: str, values: Any, finest: float) -> None:
    """Refuse complex numbers, and numbers whose digits do not hold them."""
    kind = getattr(values.dtype, "kind", "")
    if kind == "c":
        raise InputError.of_value(who, "complex numbers; give the real ones")
    if kind != "f" or values.dtype.itemsize >= 8 or not np.size(values):
        return
    magnitude = np.abs(np.asarray(values))
    largest = magnitude[np.isfinite(magnitude)].max(initial=0.0)
    if (step := float(np.spacing(largest))) > finest:
        raise InputError.of_value(
            who,
            f"{values.dtype} resolves values of {float(largest):.10g} to {step:.2g} only;"
            " use float64 from the first reading on, since lost digits cannot be restored",
        )


def _refuse_times(who: str, values: Any) -> None:
    """Refuse dates and durations, in an array or a column of pandas, as such or as objects."""
    kind = getattr(values.dtype, "kind", "")
    objects = values.dtype == object and np.size(values) > 0
    first = np.asarray(values).flat[0] if objects else None
    if kind == "M" or isinstance(first, date | np.datetime64):
        raise InputError.of_value(
            who,
            f"dates ({values.dtype}), whose time scale is unknown; convert the dates: week, tow = "
            'insgnss.gps_from_dates(dates, "utc" or "gpst")',
        )
    if kind == "m" or isinstance(first, timedelta | np.timedelta64):
        raise InputError.of_value(
            who, f"durations ({values.dtype}); give seconds: divide by np.timedelta64(1, 's')"
        )


def freeze_field(
    record: Any, name: str, shape: tuple[int | None, ...], finite: bool = True
) -> Array:
    """Replace a field by a read-only contiguous float64 array, checked for shape and finiteness.

    `shape` holds None for a length that may be any; without `finite` any value may stand.
    """
    kind = type(record).__name__
    values = np.ascontiguousarray(float_array(f"{kind}.{name}", getattr(record, name)))
    if values.ndim != len(shape) or any(
        expected is not None and expected != actual
        for expected, actual in zip(shape, values.shape, strict=True)
    ):
        raise InputError(
            f"{kind}.{name}: shape {values.shape}, expected"
            f" {tuple('n' if length is None else length for length in shape)}"
        )
    if finite and not np.isfinite(values).all():
        row, *column = (int(index) for index in np.argwhere(~np.isfinite(values))[0])
        raise InputError(
            f"{kind}.{name}: value in row {row} is not finite{_where(record, values, row, column)}"
        )
    if values.flags.writeable:
        values = values.view()
        values.flags.writeable = False
    object.__setattr__(record, name, values)
    return values


def freeze(record: Any, shapes: Mapping[str, tuple[int | None, ...]]) -> None:
    """Freeze the arrays of a record as `freeze_field` does; with the default None, None stays."""
    for name, shape in shapes.items():
        if getattr(record, name) is not None or getattr(type(record), name, ...) is not None:
            freeze_field(record, name, shape)


def frozen_integers(record: Any, name: str) -> NDArray[np.int64]:
    """Return the integers of a field of a frozen record, which holds a copy that stays as it is."""
    numbers = np.array(getattr(record, name), dtype=np.int64)
    numbers.setflags(write=False)
    object.__setattr__(record, name, numbers)
    return numbers


def _where(record: Any, values: Array, row: int, column: list[int]) -> str:
    """Column and time of a value of a record, and what to do about it."""
    time = np.asarray(getattr(record, "time", ()), dtype=np.float64)
    of_rows = time.ndim == 1 and time.size == values.shape[0]
    parts = [f"column {', '.join(map(str, column))} (from 0)"] if column else []
    parts += [f"time {time[row]:.6f} s"] if of_rows and np.isfinite(time[row]) else []
    advice = "leave the row out (a missing row of IMU samples is a gap, which is bridged)"
    return "".join([*(f", {word}" for word in parts), f"; {advice}" if of_rows else ""])


def increasing(record: Any, time: Array) -> None:
    unordered = time[1:] <= time[:-1]
    if unordered.any():
        row = int(np.argmax(unordered)) + 1
        raise InputError(
            f"{type(record).__name__}.time: {time[row]:.6f} s in row {row} follows"
            f" {time[row - 1]:.6f} s; time must increase: sort by time, or leave the row out"
        )
