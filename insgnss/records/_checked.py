"""What every record checks at its birth."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError

Array = NDArray[np.float64]


def frozen(record: Any, name: str, shape: tuple[int | None, ...]) -> Array:
    """Replace a field by a read-only contiguous float64 array, checked for shape and finiteness.

    `shape` holds None for a length that may be any.
    """
    a = np.ascontiguousarray(getattr(record, name), dtype=np.float64)
    kind = type(record).__name__
    if a.ndim != len(shape) or any(
        want is not None and want != got for want, got in zip(shape, a.shape, strict=True)
    ):
        raise InputError(
            f"{kind}.{name}: shape {a.shape}, expected"
            f" {tuple('n' if s is None else s for s in shape)}"
        )
    if not np.isfinite(a).all():
        row = int(np.argwhere(~np.isfinite(a))[0][0])
        raise InputError(f"{kind}.{name}: value in row {row} is not finite")
    if a.flags.writeable:
        a = a.view()
        a.flags.writeable = False
    object.__setattr__(record, name, a)
    return a


def increasing(record: Any, time: Array) -> None:
    step = np.diff(time)
    if (step <= 0).any():
        row = int(np.argmax(step <= 0)) + 1
        raise InputError(
            f"{type(record).__name__}.time: {time[row]:.6f} s in row {row} follows"
            f" {time[row - 1]:.6f} s; time must increase"
        )
