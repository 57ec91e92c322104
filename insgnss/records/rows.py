"""Rows of a record by name, index, mask and time, and records as tables of other libraries.

Every record whose fields hold one row for each sample, fix, image or epoch inherits `Rows`. Each
way of choosing rows gives a record of the same kind, one row included, so that whatever takes the
whole takes a part of it:

    eo["DSC0042"]    eo[["DSC0042", "DSC0050"]]    eo["DSC0042":"DSC0061"]      images by name
    eo[3]            eo[10:20]                     eo[[3, 5, 8]]                rows by index
    eo[eo.time > t]                                                             rows by mask
    eo.between(t_0, t_1)                           eo.at(t)                     rows by time, s

A slice of names includes both ends, as pandas has it; a slice of indices excludes its last one.

Covariances between neighbours (`cross`) belong to rows k and k + 1. A choice of neighbours that
leaves none out and keeps the order keeps them; any other choice has None for them, since the
covariance between rows that were no neighbours is not known. It is never taken for zero.
"""

import difflib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import DataError, InputError, UsageError
from ..base.wording import DOCTOR
from ._checked import Array, freeze, freeze_field, increasing

if TYPE_CHECKING:
    import pandas
    import xarray

SAME_INSTANT_S = 1e-6
"""Stamps that differ by less are of one instant: clocks are kept to 0.1 microseconds in a week."""

SHOWN_ROWS = 5
"""Rows at either end that a notebook shows: more than ten fill a screen."""

_AXIS_NAMES = {3: "axis", 6: "pose", 9: "state"}  # names of dimensions in xarray, by their length

Chosen = slice | NDArray[np.int64]
RowShapes = Mapping[str, tuple[int, ...] | None]


def rows_of(
    record: object, rows: Chosen | NDArray[np.bool_], fields: Iterable[str]
) -> dict[str, Any]:
    """Return some rows of fields that have one row each; of those that are None or empty no more.

    Parameters
    ----------
    record : object
        Whose fields they are.
    rows : slice, or ndarray of int or bool
        Which rows, in this order.
    fields : iterable of str
        Names of tuples and arrays.

    Returns
    -------
    dict
        By name, for `dataclasses.replace`.
    """
    chosen: dict[str, Any] = {}
    for name in fields:
        value = getattr(record, name)
        if isinstance(value, tuple) and value:
            chosen[name] = tuple(value[k] for k in np.arange(len(value))[rows])
        elif isinstance(value, np.ndarray):
            chosen[name] = value[rows]
    return chosen


def covariance_of_rows(cov: Array, rows: NDArray[np.int64], size: int = 6) -> Array:
    """Return the covariance of some rows of a joint one.

    Parameters
    ----------
    cov : ndarray, (size n, size n)
        Of n rows, one after the other.
    rows : ndarray, (k,)
        The rows.
    size : int
        Components of a row.

    Returns
    -------
    ndarray, (size k, size k)
        Row after row.
    """
    columns = (size * np.asarray(rows)[:, None] + np.arange(size)).ravel()
    return np.asarray(cov[np.ix_(columns, columns)])


class Rows:
    """Access to the rows of a record, for its sub-classes.

    A sub-class names the fields that have one row each in `_ROWS`, with the shape of the array of a
    row (None: no array of finite numbers), the noun for one row in `_NOUN`, and, where it has them,
    the field of names in `_NAMES` and the field of n - 1 matrices of the shape of `cov` that tie
    each row to the next in `_CROSS`. Its field `time` is in s.
    """

    _ROWS: ClassVar[RowShapes] = {}
    _NOUN: ClassVar[str] = "rows"
    _NAMES: ClassVar[str | None] = None
    _CROSS: ClassVar[str | None] = None
    time: Array

    def __post_init__(self) -> None:
        """Check and freeze the rows, whose time must increase and whose names must differ."""
        self._freeze_rows()
        increasing(self, self.time)
        names = () if self._NAMES is None else getattr(self, self._NAMES)
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            source = getattr(self, "source", "") or type(self).__name__
            raise InputError(f"{source}: image {twice[:80]} occurs twice; leave one of them out")

    def _freeze_rows(self) -> int:
        """Check and freeze names and arrays, and return how many rows there are."""
        if self._NAMES is None:
            n = freeze_field(self, "time", (None,)).size
        else:
            names = tuple(getattr(self, self._NAMES))
            object.__setattr__(self, self._NAMES, names)
            n = len(names)
        freeze(self, {name: (n, *of) for name, of in self._ROWS.items() if of is not None})
        if self._CROSS is not None and getattr(self, self._CROSS) is not None:
            freeze_field(self, self._CROSS, (max(n - 1, 0), *(self._ROWS["cov"] or ())))
        return n

    def __len__(self) -> int:
        """Return the number of rows."""
        return int(self.time.size)

    def __iter__(self) -> Iterator[Self]:
        """Iterate over records of one row each."""
        return (self._taken(slice(k, k + 1)) for k in range(len(self)))

    def __getitem__(self, key: Any) -> Self:
        """Return the chosen rows as a record of the same kind.

        Parameters
        ----------
        key : name, index, slice of either, sequence of either, or (n,) boolean mask.

        Returns
        -------
        The rows, in the order of the key.

        Raises
        ------
        KeyError : there is no row of that name; the message names the nearest.
        IndexError : an index is beyond the rows, or a mask has another length.
        """
        return self._taken(self._chosen(key))

    def between(self, first_s: float, last_s: float) -> Self:
        """Return the rows from one instant to another.

        Parameters
        ----------
        first_s, last_s : s, of the same week as `time`; rows at both ends are included.

        Returns
        -------
        The rows; where there are none, a record without rows, if it may be empty.
        """
        first_row = int(np.searchsorted(self.time, first_s - SAME_INSTANT_S))
        next_row = int(np.searchsorted(self.time, last_s + SAME_INSTANT_S, side="right"))
        return self._taken(slice(first_row, max(first_row, next_row)))

    def at(self, time_s: ArrayLike, tolerance_s: float = SAME_INSTANT_S) -> Self:
        """Return the rows whose stamps are the given instants.

        Parameters
        ----------
        time_s : one instant or (k,) instants, s.
        tolerance_s : greatest difference between an instant and its row, s.

        Returns
        -------
        One row for each instant, in the order of the instants.

        Raises
        ------
        DataError : no row is that near an instant; the message names the nearest stamp.
        """
        instants = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
        rows = self._nearest(instants)
        too_far = (
            np.abs(self.time[rows] - instants) > tolerance_s if len(self) else np.ones(1, bool)
        )
        if too_far.any():
            k = int(np.argmax(too_far))
            nearest = (
                f"the nearest is at {self.time[rows[k]]:.6f} s" if len(self) else "it is empty"
            )
            raise DataError(
                f"{type(self).__name__}: none of {len(self)} {self._NOUN} is at {instants[k]:.6f}"
                f" s; {nearest}; choose by between(), or give a larger tolerance_s"
            )
        return self._taken(rows)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return the rows as a pandas table with units in the names of its columns.

        Returns
        -------
        The table. Its index is the image's name where rows have names, else the time `tow`, s;
        `attrs` holds the GPS week. Covariances are given as standard deviations.

        Raises
        ------
        UsageError : pandas is not installed.
        """
        pandas = _imported("pandas")
        columns = self._columns()
        index = columns.pop("image" if self._NAMES else "tow")
        name = "image" if self._NAMES else "tow"
        frame = pandas.DataFrame(columns, index=pandas.Index(index, name=name))
        frame.attrs["gps_week"] = getattr(self, "gps_week", None)
        return frame

    def to_xarray(self) -> "xarray.Dataset":
        """Return the fields as an xarray data set, covariances and all.

        Returns
        -------
        The data set. Its first dimension is `image` where rows have names, else `time`; vectors
        have a dimension `axis`, matrices a second one. SI units and radians, as in the record.

        Raises
        ------
        UsageError : xarray is not installed.
        """
        xarray = _imported("xarray")
        row = "image" if self._NAMES else "time"
        variables: dict[str, Any] = {}
        for field in self._ROWS:
            value = getattr(self, field)
            if value is None or field == self._NAMES:
                continue
            trailing = [_AXIS_NAMES.get(size, f"dim_{size}") for size in np.shape(value)[1:]]
            if len(trailing) == 2 and trailing[0] == trailing[1]:
                trailing[1] += "_2"
            variables[field] = ((row, *trailing), value)
        coordinates = {"image": list(getattr(self, self._NAMES))} if self._NAMES else {}
        return xarray.Dataset(
            variables, coordinates, {"gps_week": str(getattr(self, "gps_week", ""))}
        )

    def __repr__(self) -> str:
        """Return kind, number of rows, span and week in one line."""
        count = f"{len(self)} {self._NOUN}"
        if not len(self):
            return f"<{type(self).__name__} {count}>"
        week = getattr(self, "gps_week", None)
        facts = [count, f"TOW {self.time[0]:.1f} to {self.time[-1]:.1f} s"]
        facts += [] if week is None else [f"week {week}"]
        return f"<{type(self).__name__} {', '.join([*facts, *self._details()])}>"

    def _repr_html_(self) -> str:
        """Return the first and last rows as a table, where pandas is installed; else one line."""
        index = np.arange(len(self))
        ends = index[(index < SHOWN_ROWS) | (index >= len(self) - SHOWN_ROWS)]
        try:
            table = self[ends].to_pandas().to_html()
        except UsageError:
            table = ""
        return f"<p>{escape(repr(self))}</p>{table}"

    def _details(self) -> Sequence[str]:
        """What else the short form says."""
        return ()

    def _columns(self) -> dict[str, Any]:
        """Columns (n,) of the table, by names with units; `tow` and, with names, `image` first."""
        raise NotImplementedError

    def _position_columns(self: Any) -> dict[str, Any]:
        """The columns of time and of a geodetic position."""
        lat, lon = np.degrees(self.lat), np.degrees(self.lon)
        return {"tow": self.time, "lat_deg": lat, "lon_deg": lon, "h_m": self.height}

    def _nearest(self, instants: Array) -> NDArray[np.int64]:
        if not len(self):
            return np.zeros(instants.size, dtype=np.int64)
        row_after = np.clip(np.searchsorted(self.time, instants), 0, len(self) - 1)
        row_before = np.maximum(row_after - 1, 0)
        nearer = np.abs(self.time[row_before] - instants) <= np.abs(self.time[row_after] - instants)
        return np.where(nearer, row_before, row_after).astype(np.int64)

    def _chosen(self, key: Any) -> Chosen:
        if isinstance(key, str):
            row = self._row(key)
            return slice(row, row + 1)
        if isinstance(key, slice):
            return self._slice(key)
        if isinstance(key, int | np.integer):
            return self._rows(np.array([key]))
        if not len(key):
            return np.zeros(0, dtype=np.int64)
        if isinstance(key[0], str):
            return np.array([self._row(name) for name in key], dtype=np.int64)
        return self._rows(np.asarray(key))

    def _slice(self, key: slice) -> Chosen:
        start = self._row(key.start) if isinstance(key.start, str) else key.start
        stop = self._row(key.stop) + 1 if isinstance(key.stop, str) else key.stop
        first, last, step = slice(start, stop, key.step).indices(len(self))
        if step == 1:
            return slice(first, max(first, last))
        return np.arange(first, last, step, dtype=np.int64)

    def _rows(self, key: NDArray[Any]) -> NDArray[np.int64]:
        if key.dtype == np.bool_:
            if key.shape != (len(self),):
                raise IndexError(f"mask of shape {key.shape} for {len(self)} {self._NOUN}")
            return np.flatnonzero(key).astype(np.int64)
        if key.ndim != 1 or not np.issubdtype(key.dtype, np.integer):
            raise IndexError(
                "rows are chosen by name, index, slice, sequence or mask; by time: .at()"
            )
        if ((key < -len(self)) | (key >= len(self))).any():
            raise IndexError(f"index {int(np.abs(key).max())} is beyond {len(self)} {self._NOUN}")
        return np.where(key < 0, key + len(self), key).astype(np.int64)

    def _row(self, name: str) -> int:
        if self._NAMES is None:
            raise KeyError(f"{type(self).__name__} has no names; its rows have an index and a time")
        names = getattr(self, self._NAMES)
        try:
            return int(names.index(name))
        except ValueError:
            similar = ", ".join(difflib.get_close_matches(name, names, n=3)) or ", ".join(names[:3])
            raise KeyError(
                f"{name!r} is none of {len(names)} {self._NOUN}; near: {similar}"
            ) from None

    def _taken(self, rows: Chosen) -> Self:
        """The rows; those of neighbours in their order without a copy and with what ties them."""
        if not isinstance(rows, slice) and rows.size and (np.diff(rows) == 1).all():
            rows = slice(int(rows[0]), int(rows[-1]) + 1)
        changes = rows_of(self, rows, self._ROWS)
        if self._CROSS is not None and (cross := getattr(self, self._CROSS)) is not None:
            pairs = (
                slice(rows.start, max(rows.start, rows.stop - 1))
                if isinstance(rows, slice)
                else None
            )
            changes[self._CROSS] = None if pairs is None else cross[pairs]
        return replace(self, **changes)  # type: ignore[type-var]


def _imported(library: str) -> Any:
    """The library, or a UsageError that says how to get it."""
    from importlib import import_module

    try:
        return import_module(library)
    except ImportError:
        message = (
            f"{library} is not installed; pip install {library}, or use the arrays of the record;"
            f" {DOCTOR}"
        )
        raise UsageError(message) from None
