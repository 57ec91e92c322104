"""MATLAB's binary formats of version 4 to 7: lengths are checked, then scipy reads the variables.

scipy trusts the lengths and dimensions that a file states. A cut or hostile one could therefore
pass for a shorter recording, or ask for memory that no recording needs. So the elements of a
version 5 to 7 file (MathWorks, "MAT-File Format": a tag of type and size, then the data) are walked
through first, and deflated variables are inflated to the size that they state and no further.
"""

import io
import warnings
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from ....base.errors import words_of
from ....base.unpacking import check_unpacked
from ..text.layout import printable

Bytes = memoryview

# of the file's header and of an element's tag, in version 5 to 7
MAT_HEADER_BYTES, TAG_BYTES = 128, 8
INT8, INT32, UINT32, MAT_MATRIX, COMPRESSED = 1, 5, 6, 14, 15
"""Types of elements; those of `TYPE_WIDTHS` hold numbers or text."""
TYPE_WIDTHS = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
"""Bytes of a number, or of a letter at least, by the type of its element."""
CELL, STRUCT, OBJECT, CHAR, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 16, 17
"""Classes of variables; those between `SPARSE` and `FUNCTION` are numbers."""
MATRIX_HEADS = {
    STRUCT: [INT32, INT8, INT32, INT8],
    OBJECT: [INT32, INT8, INT8, INT32, INT8],
    OPAQUE: [INT8, INT8, INT8],
}
"""Element types between flags and content: dimensions, name; of structs the fields' names."""
COMPLEX = 0x800  # bit of the flags: the values are complex (format)
DEEPEST_STRUCT_OF_FILE = 16  # structs within structs: recordings have three or four


class Damaged(ValueError):
    """The file does not hold what its lengths state."""


def read_mat(data: bytes, path: object = "MAT-file") -> dict[str, Any]:
    """Read the variables of a file of version 4 to 7.

    Parameters
    ----------
    data : bytes
        The whole file.
    path
        Its name, for the message where it unpacks to too much.

    Returns
    -------
    dict
        Variables by name: numbers as arrays with their MATLAB shape, texts as str, cells as arrays
        of objects, structs as dicts, and None for what holds no recording.

    Raises
    ------
    Damaged
        A file that is cut, damaged, or no MATLAB file.
    InputError, DataError
        Its variables unpack to more than `base.unpacking` allows.
    """
    from scipy.io import loadmat

    if len(data) >= MAT_HEADER_BYTES and data[126:128] in (b"IM", b"MI"):
        data = _check_lengths(data, "<" if data[126:128] == b"IM" else ">", path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            variables = loadmat(io.BytesIO(data), chars_as_strings=True)
    except Exception as error:  # a damaged file makes the library fail in any way
        raise Damaged(words_of(error)) from None
    out = {
        printable(name): _plain(value)
        for name, value in variables.items()
        if not name.startswith("__") and name != "None"
    }
    if not out:
        raise Damaged("no variable")
    return out


def _plain(node: Any) -> Any:
    """What scipy made of a variable, as `read_mat` returns it."""
    if not isinstance(node, np.ndarray) or type(node).__name__ == "MatlabOpaque":
        return None
    if node.dtype.names is not None or node.dtype == object:
        plain = _plain if node.dtype.names is None else _struct
        items = [plain(item) for item in node.reshape(-1)]
        if node.dtype.names is not None and len(items) == 1:
            return items[0]
        out = np.empty(len(items), dtype=object)
        out[:] = items
        return out.reshape(node.shape)
    if node.dtype.kind == "U":
        if node.size <= 1:
            return "".join(node)
        return np.array([text.rstrip() for text in node.reshape(-1)], dtype=object)
    return np.real(node)


def _struct(item: Any) -> dict[str, Any]:
    return {printable(name): _plain(item[name]) for name in item.dtype.names}


def _check_lengths(data: bytes, order: str, path: object) -> bytes:
    """The file with its variables inflated, after a look at every length."""
    elements = list(_elements(memoryview(data)[MAT_HEADER_BYTES:], order))
    stated = sum(_stated_length(kind, body, order) for kind, body in elements)
    check_unpacked(path, stated, packed=len(data))
    # without the offset of MATLAB's own subsystem data, which moves
    parts = [data[:116] + bytes(8) + data[124:MAT_HEADER_BYTES]]
    for kind, body in elements:
        if kind == COMPRESSED:
            kind, body = _inflate_element(body, order)
        if kind != MAT_MATRIX:
            raise Damaged(f"an element of type {kind} instead of a variable")
        _check_matrix(body, order, 0)
        parts += [np.array([kind, len(body)], order + "u4").tobytes(), bytes(body)]
    return b"".join(parts)


def _elements(data: Bytes, order: str) -> Iterator[tuple[int, Bytes]]:
    """Yield type and content of each element.

    One of up to 4 bytes stands within its tag, whose upper half is its size.
    """
    offset = 0
    while offset < len(data):
        if offset + TAG_BYTES > len(data):
            raise Damaged("it ends within a tag")
        kind, size = (int(v) for v in np.frombuffer(data, order + "u4", 2, offset))
        start = offset + TAG_BYTES
        if kind >> 16:
            kind, size, start = kind & 0xFFFF, kind >> 16, offset + 4
            if size > 4:
                raise Damaged(f"a short element of {size} bytes")
            offset += TAG_BYTES
        else:
            offset = start + size + (0 if kind == COMPRESSED else -size % 8)
        if start + size > len(data):
            raise Damaged(f"it ends within an element of {size} bytes")
        yield kind, data[start : start + size]


def _stated_length(kind: int, body: Bytes, order: str) -> int:
    """How many bytes a variable has, once it is inflated."""
    if kind != COMPRESSED:
        return len(body)
    try:
        head = zlib.decompressobj().decompress(body, TAG_BYTES)
    except zlib.error:  # as `_inflate_element` reports
        return 0
    return int(np.frombuffer(head, order + "u4", 2)[1]) if len(head) == TAG_BYTES else 0


def _inflate_element(body: Bytes, order: str) -> tuple[int, Bytes]:
    """Type and content of a deflated element."""
    stream = zlib.decompressobj()
    try:
        head = stream.decompress(body, TAG_BYTES)
        if len(head) < TAG_BYTES:
            raise Damaged("it ends within a deflated tag")
        kind, size = (int(v) for v in np.frombuffer(head, order + "u4", 2))
        inner = stream.decompress(stream.unconsumed_tail, size + 1) if size else b""
    except zlib.error as error:
        raise Damaged(f"a deflated variable is damaged: {error}") from None
    if len(inner) != size or not stream.eof:
        raise Damaged(f"a deflated variable of {size} bytes is cut")
    return kind, memoryview(inner)


def _check_matrix(body: Bytes, order: str, depth: int) -> None:
    """Refuse a variable whose elements are not those of its class and dimensions.

    scipy does not check them, and may crash.
    """
    if depth > DEEPEST_STRUCT_OF_FILE:
        raise Damaged("structs within structs beyond reason")
    elements = list(_elements(body, order))
    if not elements:
        return
    if len(body) % 8 or elements[0][0] != UINT32 or len(elements[0][1]) != 8:
        raise Damaged("a variable without flags")
    flags = int(np.frombuffer(elements[0][1], order + "u4", 1)[0])
    form = flags & 0xFF
    head = MATRIX_HEADS.get(form, [INT32, INT8])
    content = elements[1 + len(head) :]
    if [kind for kind, _ in elements[1 : 1 + len(head)]] != head or not 0 < form <= OPAQUE:
        raise Damaged("a variable without dimensions and name")
    count = 1 if form == OPAQUE else _count(elements[1][1], order, len(body), form)
    expected = 1
    if form in (CELL, STRUCT, OBJECT):
        packed = elements[len(head) - 1 : len(head) + 1]
        expected = count * (1 if form == CELL else _fields(packed[0][1], packed[1][1], order))
    elif SPARSE <= form < FUNCTION:
        expected = (3 if form == SPARSE else 1) + bool(flags & COMPLEX)
    if len(content) != expected:
        raise Damaged(f"a variable holds {len(content)} parts, expected {expected}")
    for kind, inner in content:
        if CHAR <= form < FUNCTION:
            if kind not in TYPE_WIDTHS or (
                form > SPARSE and len(inner) != count * TYPE_WIDTHS[kind]
            ):
                raise Damaged(f"{count} values in {len(inner)} bytes of type {kind}")
        elif kind != MAT_MATRIX:
            raise Damaged(f"an element of type {kind} instead of a cell or a field")
        else:
            _check_matrix(inner, order, depth + 1)


def _count(dimensions: Bytes, order: str, size: int, form: int) -> int:
    """How many values a variable of `size` bytes holds by its dimensions."""
    shape = np.frombuffer(dimensions, order + "i4") if len(dimensions) % 4 == 0 else np.empty(0)
    count = int(np.prod(shape, dtype=object))
    if shape.size < 2 or shape.min() < 0 or (count > size and form != SPARSE):
        raise Damaged(f"a variable of {' x '.join(map(str, shape))} in {size} bytes")
    return count


def _fields(width: Bytes, names: Bytes, order: str) -> int:
    """How many fields a struct has, whose names stand packed at a stated width."""
    step = int(np.frombuffer(width, order + "i4", 1)[0]) if len(width) == 4 else 0
    if step < 1 or len(names) % step:
        raise Damaged(f"a struct with names of fields of {step} bytes")
    return len(names) // step
