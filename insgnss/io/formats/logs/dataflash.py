"""Messages of ArduPilot's DataFlash logs, binary and as text, as tables: data_specs/ardupilot.md.

A binary log is a chain of messages A3 95 kind ..., each of the length that an FMT message gave its
kind; the chain is walked here, so that a cut or damaged log is noticed, and the fields are taken by
pymavlink's table of types and multipliers. In a text log FMT lines name the columns. Messages of
several sensors become tables of their own: IMU, IMU2, ... and GPS, GPS2, ...
"""

import numpy as np
from numpy.typing import NDArray

from ....base.advance import through
from ....base.errors import InputError, installed
from ....base.wording import DOCTOR
from ..text.layout import decode, float_of, printable
from ..text.text import Source, load, load_bytes
from .autopilot import Array, Log, Tables, as_float

NEEDS_PYMAVLINK = (
    "needs pymavlink, which reads ArduPilot logs; it is not installed: pip install 'insgnss[logs]';"
    f" {DOCTOR}"
)
FMT = 128  # number of the message that gives the formats of all others: the format's
LOST_LIMIT = 0.01  # share of bytes or lines that are no message: torn ones are fewer (chosen)
TEXT_TYPES = "nNZMa"  # letters of a format: texts, modes (which logs as text name), arrays


def read_log(path: Source) -> Log:
    """Read all messages of a log.

    Raises
    ------
    InputError
        More than 1 % of the file is no message.
    """
    head = load_bytes(path)
    return _binary(path, head) if head[:1].tobytes() == b"\xa3" else _text(path)


def _binary(path: Source, buf: NDArray[np.uint8]) -> Log:
    from ..text import _kernels

    with installed(NEEDS_PYMAVLINK, path):
        from pymavlink.DFReader import FORMAT_TO_STRUCT
    lengths = np.zeros(256, dtype=np.int64)
    lengths[FMT] = 89
    kinds, places = (np.empty(buf.size // 3 + 1, dtype=np.int64) for _ in range(2))
    n, n_lost, cut, wrong = _kernels.dataflash_messages(buf, lengths, kinds, places)
    if wrong >= 0 or n == 0:
        problem = f"is no ArduPilot log: no valid message at byte {max(wrong, 0)}"
    elif n_lost > LOST_LIMIT * buf.size:
        problem = f"{n_lost} of {buf.size} bytes belong to no message (limit {LOST_LIMIT:.0%})"
    else:
        problem = ""
    if problem:
        raise InputError.in_file(path, f"{problem}; copy it again from the card")
    kinds, places = kinds[:n], places[:n]
    tables: Tables = {}
    notes = [f"{n_lost} bytes that belong to no message left out"] if n_lost else []
    for name, labels, form, kind in _formats(buf, places[kinds == FMT]):
        starts = places[kinds == kind]
        types = [FORMAT_TO_STRUCT.get(letter) for letter in form]
        if kind == FMT or starts.size == 0 or None in types or len(labels) != len(form):
            continue
        # letters of the struct module are numpy's; a count before them is that of a text
        codes = [f"<{t[0]}" if len(t[0]) == 1 else f"S{t[0][:-1]}" for t in types]
        dtype = np.dtype([(f"f{i}", code) for i, code in enumerate(codes)])
        if dtype.itemsize + 3 != lengths[kind]:
            continue
        rows = buf[starts[:, None] + np.arange(3, 3 + dtype.itemsize)].view(dtype).reshape(-1)
        table = {
            label: as_float(rows[f"f{i}"]) * (types[i][1] or 1.0)
            for i, label in enumerate(labels)
            if dtype[i].kind in "iuf"
        }
        notes += _by_instance(tables, name, table)
    if cut >= 0:
        notes.append(f"the file ends within a message at byte {cut}, which is left out")
    return Log(str(path), tables, tuple(notes))


def _formats(
    buf: NDArray[np.uint8], places: NDArray[np.int64]
) -> list[tuple[str, list[str], str, int]]:
    """Return name, labels, format and kind of each FMT message, the last one of a kind."""
    formats: dict[int, tuple[str, list[str], str, int]] = {}
    for start in places.tolist():
        body = buf[start + 3 : start + 89].tobytes()
        name, form, labels = (
            printable(text.split(b"\0")[0].decode("ascii", "replace"))
            for text in (body[2:6], body[6:22], body[22:86])
        )
        formats[body[0]] = (name, labels.split(","), form, body[0])
    return list(formats.values())


def _text(path: Source) -> Log:
    """Read a log as text: `FMT, kind, length, name, format, labels` lines, then `name, values`."""
    buf, complete = load(path)
    labels: dict[str, list[str]] = {}
    forms: dict[str, str] = {}
    rows: dict[str, list[list[float]]] = {}
    n_lost, lines = 0, decode(bytes(buf[:-1])).split("\n")
    for text in through(lines):
        name, *fields = (field.strip() for field in text.split(","))
        if name == "FMT" and len(fields) > 4 and fields[2] not in rows:
            labels[fields[2]] = [printable(field) for field in fields[4:]]
            forms[fields[2]] = fields[3]
        elif name in labels and (row := _row(fields, forms[name], len(labels[name]))) is not None:
            rows.setdefault(name, []).append(row)
        elif text.strip() and not (
            name == "FMT" and labels.get(fields[2] if len(fields) > 2 else "") == fields[4:]
        ):
            n_lost += 1
    whole = [line for line in lines if line.strip()]
    if n_lost > LOST_LIMIT * len(whole) or not rows:
        problem = f"{n_lost} of {len(whole)} lines are no message (limit {LOST_LIMIT:.0%})"
        raise InputError.in_file(path, f"{problem}; is it an ArduPilot log?")
    tables: Tables = {}
    notes = [f"{n_lost} lines that are no message left out"] if n_lost else []
    for name, values in rows.items():
        table = dict(zip(labels[name], np.array(values).T.copy(), strict=True))
        notes += _by_instance(tables, name, table)
    notes += [] if complete else ["the last line has no line break, so it may be incomplete"]
    return Log(str(path), tables, tuple(notes))


def _row(fields: list[str], form: str, count: int) -> list[float] | None:
    """Return the numbers of a message's fields, not-a-number for text and where `nan` is written.

    The result is None for another count of fields, or where a number cannot be read.
    """
    row = [
        np.nan if kind in TEXT_TYPES or field.lower().lstrip("+-") == "nan" else float_of(field)
        for field, kind in zip(fields, form.ljust(count), strict=False)
    ]
    numbers = [x for x in row if x is not None]
    return numbers if len(numbers) == len(fields) == count else None


def _by_instance(tables: Tables, name: str, table: dict[str, Array]) -> tuple[str, ...]:
    """Add a message's table, and return what was odd in it.

    Those of further sensors (field I: 1, 2, ...) stand under names with a number.
    """
    instance = table.get("I")
    if instance is None or (instance == 0).all():
        tables[name] = table
        return ()
    numbered = np.isin(instance, np.arange(256))
    for k in np.unique(instance[numbered]).astype(np.int64).tolist():
        tables[name if k == 0 else f"{name}{k + 1}"] = {
            label: column[instance == k] for label, column in table.items()
        }
    unnumbered = int(numbered.size - numbered.sum())
    finding = f"{unnumbered} {name} messages without a sensor number left out"
    return (finding,) if unnumbered else ()
