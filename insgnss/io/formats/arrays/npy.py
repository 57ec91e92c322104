"""Arrays of numpy (.npy, .npz), data_specs/npy.md: samples by a column map.

Raw counts are scaled by units with the value of one count.

A `.npy` is one array (n, m), or a record array whose fields name the columns; a `.npz` holds
several by name. Objects are not loaded.
"""

import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ....base.errors import InputError, legible
from ....base.inputs import open_bytes
from ....base.unpacking import check_archive
from ..text.layout import printable
from ..text.text import Source
from .content import Content, matrix_of


def load_numpy(path: Source) -> Content:
    """Load the arrays of a file by name.

    The one array of a .npy has an empty name; the fields of a record array become a mapping.
    """
    if not Path(path).is_file():
        raise InputError.in_file(path, "no such file; check the path")
    with (
        legible(path, "is no whole numpy file ({}); copy it again from its source"),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("error")
        with open_bytes(path) as stream:
            packed = stream.read(2) == b"PK"
        if packed:
            with (
                open_bytes(path) as stream,
                np.load(stream, allow_pickle=False) as archive,
            ):
                check_archive(path, archive.zip)
                return {printable(name): _plain(archive[name]) for name in archive.files}
        with open_bytes(path) as stream:
            array = np.load(stream, allow_pickle=False)
            expected, size = stream.tell(), stream.seek(0, os.SEEK_END)
        if size != expected:
            raise ValueError(f"{size} bytes, expected {expected}")
    if array.dtype.names:
        return _plain(array)
    return {"": _plain(array)}


def _plain(array: Any) -> Any:
    if array.dtype.names:
        return {printable(name): np.asarray(array[name]).reshape(-1) for name in array.dtype.names}
    return matrix_of(np.asarray(array)) if array.ndim == 2 and array.size else np.asarray(array)
