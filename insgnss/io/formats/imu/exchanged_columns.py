"""The `columns` with which a file's samples are read with two axes exchanged in both triads."""

from collections.abc import Mapping
from pathlib import Path

from ....base.errors import InsgnssError
from ..text.columns import Columns
from ..text.layout import sniff
from ..text.text import Source, loaded
from .imu_csv import required_columns, with_required


def exchanged_columns(
    path: Source,
    pair: tuple[int, int],
    columns: Columns = None,
    rate_hz: float | None = None,
    accel_file: Source | None = None,
) -> dict[str, str] | list[str] | None:
    """Return `columns` of a flight file in which two axes have changed places.

    Parameters
    ----------
    path : path
        The file of the samples.
    pair : tuple of int
        The axes, 0 to 2.
    columns : sequence or mapping, optional
        Those by which it is read.
    rate_hz : float, optional
        The rate of a table without a column of time.
    accel_file : path, optional
        The file of the accelerometers, where they have their own.

    Returns
    -------
    mapping, list or None
        Of the kind that was given; a list where none was. None where the format takes no
        `columns`, or each of two files has its own header.
    """
    from .. import readers, sniff_imu

    if "columns" not in readers("imu")[sniff_imu(Path(path))].options.split():
        return None
    a, b = ("xyz"[k] for k in pair)
    swapped = {f"g{a}": f"g{b}", f"g{b}": f"g{a}", f"a{a}": f"a{b}", f"a{b}": f"a{a}"}
    if isinstance(columns, Mapping):
        return {name: columns[swapped.get(name, name)] for name in columns}
    names = columns or (None if accel_file is not None else _names(path, rate_hz))
    return None if names is None else [swapped.get(name, name) for name in names]


def _names(path: Source, rate_hz: float | None) -> list[str] | None:
    """Names of all columns of a text table in their order; None where it is no such table."""
    spec = with_required(required_columns(rate_hz))
    try:
        with loaded(path) as (buf, _):
            layout = sniff(path, buf)
            index = spec.index(str(path), layout)
    except InsgnssError:
        return None
    names = ["-"] * layout.n_fields
    for name, k in index.items():
        names[k] = name
    return names
