"""Variables of MATLAB files, data_specs/matlab.md.

Version 4 to 7 is read by scipy behind the checks of `matfile`, 7.3 (HDF5) by h5py where it is
installed. There is no default: `columns` says which field, label or column of a matrix holds which
quantity; `content` states how they are named.

There is no default: `columns` says which field, label or column of a matrix is what; `_content`
states how they are named.
"""

import os
from typing import Any

import numpy as np

from ....base.errors import InputError, legible, required_library
from ....base.unpacking import check_unpacked
from ....base.wording import DOCTOR
from ..text.layout import printable
from ..text.text import Source, load_bytes
from .content import Content, Matrix, matrix_of
from .matfile import Damaged, read_mat

LABEL_SUFFIX = "_label"
HDF5 = b"\x89HDF\r\n\x1a\n"
DEEPEST_STRUCT = 8  # structs within structs that are read: recordings have three or four


def load_matlab(path: Source) -> Content:
    """Load the variables of a file by name.

    Structs become mappings; matrices have the labels of the variable `<name>_label` beside them.
    """
    data = load_bytes(path).tobytes()
    if HDF5 in data[:1024]:
        return _with_labels(_hdf5(path))
    try:
        variables = read_mat(data, path)
    except Damaged as error:
        raise InputError.in_file(
            path, f"is no whole MATLAB file ({error}); copy it again from its source"
        ) from None
    return _with_labels({name: _plain(node) for name, node in variables.items()})


def _plain(node: Any) -> Any:
    """Arrays of one row or column as vectors, of more as `Matrix`; the others as they stand."""
    if isinstance(node, dict):
        return {name: _plain(value) for name, value in node.items()}
    if not isinstance(node, np.ndarray) or node.ndim != 2:
        return node
    return matrix_of(node) if node.size and node.dtype != object else node.reshape(-1)


def _with_labels(content: dict[str, Any]) -> dict[str, Any]:
    """Content with the labels at their matrices."""
    out = dict(content)
    for name, node in content.items():
        if isinstance(node, Matrix) and (labels := content.get(name + LABEL_SUFFIX)) is not None:
            texts = tuple(printable(str(text)) for text in np.asarray(labels, object).reshape(-1))
            if len(texts) == node.values.shape[1]:
                out[name] = Matrix(node.values, texts)
    return out


def _hdf5(path: Source) -> dict[str, Any]:
    problem = (
        "is a MATLAB 7.3 file (HDF5), which needs h5py: pip install h5py; or save it with -v7;"
        f" {DOCTOR}"
    )
    with required_library(problem, path):
        import h5py

    def stated(node: Any, depth: int = 0) -> int:
        """Bytes of what a node holds, without reading it."""
        if not isinstance(node, h5py.Group):
            return int(node.nbytes)
        return sum(stated(node[name], depth + 1) for name in node if depth < DEEPEST_STRUCT)

    def plain(node: Any, depth: int = 0) -> Any:
        if isinstance(node, h5py.Group):
            return {
                printable(name): plain(node[name], depth + 1)
                for name in node
                if depth < DEEPEST_STRUCT
            }
        if node.attrs.get("MATLAB_class") == b"char":
            return "".join(map(chr, node[()].reshape(-1)))
        if node.dtype == h5py.ref_dtype:
            return np.array(
                [plain(file[ref], depth + 1) for ref in node[()].reshape(-1)], dtype=object
            )
        values = node[()].T  # MATLAB stores columns first
        whole = values.ndim == 2 and values.size
        return matrix_of(values) if whole else np.asarray(values).reshape(-1)

    damaged = "is no whole MATLAB 7.3 file ({}); copy it again from its source"
    with legible(path, damaged), h5py.File(str(path), "r") as file:
        check_unpacked(path, stated(file), packed=os.path.getsize(path))
        return {printable(name): plain(file[name]) for name in file if not name.startswith("#")}
