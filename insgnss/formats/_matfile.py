"""MATLAB's own binary formats, version 5 to 7 and 4, read strictly: every length is checked against what is there.

Version 5 (MathWorks, "MAT-File Format"): 128 bytes of header, then elements of a tag (type, bytes) and data, padded to 8 bytes; a tag whose
upper half is not zero holds its up to 4 bytes itself. A matrix is an element of elements: flags, dimensions, name, and by its class
numbers (column by column), text, cells or fields; in version 7 each variable is deflated. Version 4 is a chain of headers of five
integers with name and numbers. Sparse matrices, objects and functions are passed over: they hold no recording.
"""

import zlib
from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._layout import printable

Bytes = memoryview

HEADER_BYTES, TAG_BYTES = 128, 8
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
INT8, INT32, UINT32, MATRIX, COMPRESSED = 1, 5, 6, 14, 15
TEXTS = {2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
CELL, STRUCT, CHAR, FIRST_NUMBER, LAST_NUMBER, OPAQUE = 1, 2, 4, 6, 15, (16, 17)
DEEPEST = 16
VERSION_4 = {0: "f8", 1: "f4", 2: "i4", 3: "i2", 4: "u2", 5: "u1"}


class Damaged(ValueError):
    """The file is not what its lengths say."""


def read_mat(data: bytes) -> dict[str, Any]:
    """Variables by name: arrays with their MATLAB shape, texts, cells as arrays of objects, structs as mappings; raises `Damaged`."""
    view = memoryview(data)
    if len(data) >= HEADER_BYTES and data[126:128] in (b"IM", b"MI"):
        order = "<" if data[126:128] == b"IM" else ">"
        found: Iterator[tuple[str, Any]] = (_variable(kind, body, order) for kind, body in _elements(view[HEADER_BYTES:], order))
    else:
        found = _version_4(view)
    out: dict[str, Any] = {}
    for name, value in found:
        if name in out:
            raise Damaged(f"{name} stands twice")
        if name:
            out[name] = value
    if not out:
        raise Damaged("no variable")
    return out


def _elements(data: Bytes, order: str) -> Iterator[tuple[int, Bytes]]:
    """Type and content of each element."""
    place = 0
    while place < len(data):
        if place + TAG_BYTES > len(data):
            raise Damaged("it ends within a tag")
        kind, size = (int(v) for v in np.frombuffer(data, order + "u4", 2, place))
        if kind >> 16:
            kind, size, start = kind & 0xFFFF, kind >> 16, place + 4
            if size > 4:
                raise Damaged(f"a short element of {size} bytes")
            following = place + TAG_BYTES
        else:
            start = place + TAG_BYTES
            following = start + size + (0 if kind == COMPRESSED else -size % 8)
        if start + size > len(data):
            raise Damaged(f"it ends within an element of {size} bytes")
        yield kind, data[start : start + size]
        place = following


def _variable(kind: int, body: Bytes, order: str) -> tuple[str, Any]:
    """Name and value of a variable of version 5, which may be deflated."""
    if kind == COMPRESSED:
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
        body = memoryview(inner)
    if kind != MATRIX:
        raise Damaged(f"an element of type {kind} in the place of a variable")
    return _matrix(body, order, 0)


def _matrix(body: Bytes, order: str, depth: int) -> tuple[str, Any]:
    """Name and value of a matrix; None for what holds no recording."""
    if depth > DEEPEST:
        raise Damaged("structs within structs beyond reason")
    if not len(body):
        return "", np.empty((0, 0))
    elements = _elements(body, order)
    head = list(islice(elements, 3))
    if len(head) < 3 or head[0][0] != UINT32 or len(head[0][1]) != 8:
        raise Damaged("a variable without flags")
    form = int(np.frombuffer(head[0][1], order + "u4", 1)[0]) & 0xFF
    if form in OPAQUE:
        return "", None
    if head[1][0] != INT32 or head[2][0] != INT8:
        raise Damaged("a variable without dimensions and name")
    shape = tuple(int(v) for v in np.frombuffer(head[1][1], order + "i4")) if len(head[1][1]) % 4 == 0 else ()
    name = printable(bytes(head[2][1]).decode("latin-1"))
    if len(shape) < 2 or min(shape) < 0:
        raise Damaged(f"{name or 'a field'} of dimensions {shape}")
    count = int(np.prod(shape, dtype=object))
    if form == CELL:
        return name, _objects([_inner(part, order, depth) for part in elements], count, shape, name)
    if form == STRUCT:
        return name, _struct(elements, order, depth, count, shape, name)
    if form != CHAR and not FIRST_NUMBER <= form <= LAST_NUMBER:
        return name, None
    if (part := next(elements, None)) is None:
        if form == CHAR and count == 0:
            return name, ""
        raise Damaged(f"{name or 'a field'} without numbers")
    if form == CHAR:
        return name, _text(*part, order=order, shape=shape, name=name)
    return name, _numbers(*part, order=order, count=count, shape=shape, name=name)


def _inner(part: tuple[int, Bytes], order: str, depth: int) -> Any:
    if part[0] != MATRIX:
        raise Damaged(f"an element of type {part[0]} in the place of a cell or a field")
    return _matrix(part[1], order, depth + 1)[1]


def _objects(values: list[Any], count: int, shape: tuple[int, ...], name: str) -> NDArray[Any]:
    if len(values) != count:
        raise Damaged(f"{name or 'a field'} holds {len(values)} cells, expected {count}")
    out = np.empty(count, dtype=object)
    for i, value in enumerate(values):
        out[i] = value
    return out.reshape(shape, order="F")


def _struct(elements: Iterator[tuple[int, Bytes]], order: str, depth: int, count: int, shape: tuple[int, ...], name: str) -> Any:
    """A mapping, or of a struct array an array of mappings."""
    head = list(islice(elements, 2))
    if len(head) < 2 or len(head[0][1]) != 4:
        raise Damaged(f"{name or 'a struct'} without names of fields")
    width, packed = int(np.frombuffer(head[0][1], order + "i4", 1)[0]), bytes(head[1][1])
    if width < 1 or len(packed) % width:
        raise Damaged(f"{name or 'a struct'} with names of fields of {width} bytes")
    names = [printable(packed[i : i + width].split(b"\0")[0].decode("latin-1")) for i in range(0, len(packed), width)]
    values = [_inner(part, order, depth) for part in elements]
    if len(values) != count * len(names) or len(set(names)) != len(names):
        raise Damaged(f"{name or 'a struct'} holds {len(values)} fields, expected {count * len(names)}")
    rows = [dict(zip(names, values[i * len(names) :], strict=False)) for i in range(count)]
    return rows[0] if count == 1 else _objects(rows, count, shape, name)


def _numbers(kind: int, body: Bytes, order: str, count: int, shape: tuple[int, ...], name: str) -> NDArray[Any]:
    if kind not in NUMBERS or len(body) != count * int(NUMBERS[kind][1]):
        raise Damaged(f"{name or 'a field'} of {' x '.join(map(str, shape))} holds {len(body)} bytes of type {kind}")
    return np.frombuffer(body, order + NUMBERS[kind]).reshape(shape, order="F")


def _text(kind: int, body: Bytes, order: str, shape: tuple[int, ...], name: str) -> Any:
    """A text, or of several rows an array of texts."""
    if kind not in TEXTS:
        raise Damaged(f"{name or 'a field'} holds text of type {kind}")
    code = TEXTS[kind] + ("-le" if order == "<" else "-be") * (kind in (4, 17, 18))
    text = bytes(body).decode(code, "replace")
    if shape[0] <= 1:
        return text
    if len(text) != shape[0] * shape[1]:
        return None
    return np.array(["".join(text[row :: shape[0]]).rstrip() for row in range(shape[0])], dtype=object)


def _version_4(data: Bytes) -> Iterator[tuple[str, Any]]:
    place = 0
    while place < len(data):
        if place + 20 > len(data):
            raise Damaged("no MATLAB file, or one that ends within a header")
        order = "<" if 0 <= int(np.frombuffer(data, "<i4", 1, place)[0]) < 5000 else ">"
        mopt, rows, cols, imaginary, length = (int(v) for v in np.frombuffer(data, order + "i4", 5, place))
        digits = f"{mopt:04d}" if 0 <= mopt < 5000 else "xxxx"
        form = VERSION_4.get(int(digits[2])) if digits[0] in "01" and digits[1] == "0" and digits[2].isdigit() else None
        if form is None or digits[3] not in "012" or min(rows, cols) < 0 or imaginary not in (0, 1) or not 1 < length < 256:
            raise Damaged("no MATLAB file")
        start = place + 20 + length
        size = rows * cols * int(form[1]) * (1 + imaginary)
        if start + size > len(data):
            raise Damaged(f"it ends within a variable of {size} bytes")
        values = np.frombuffer(data, order + form, rows * cols, start).reshape((rows, cols), order="F")
        name = printable(bytes(data[place + 20 : start]).split(b"\0")[0].decode("latin-1"))
        yield name, values if digits[3] == "0" else None
        place = start + size
