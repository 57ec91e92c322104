"""MATLAB's own formats, read strictly."""

import contextlib
import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import loadmat, savemat

from insgnss.io.formats.arrays.matfile import Damaged, read_mat

DATA = Path(__file__).parents[3].parent / "shared" / "data"
KINDS = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")
TEXTS = np.array(["TimeMS", "GyrX"], dtype=object).reshape(-1, 1)
CONTENT = {
    **{kind: np.arange(6).reshape(2, 3).astype(kind) for kind in KINDS},
    "scalar": 5.5,
    "empty": np.empty((0, 0)),
    "text": "flight 1",
    "labels": TEXTS,
    "rows": np.array(["ab ", "cde"]),
    "complex": np.array([[1 + 2j, 3.0]]),
    "s": {"a": np.arange(3.0), "t": {"b": np.arange(4)}, "name": "x", "cell": TEXTS},
}


def written(**options: Any) -> bytes:
    stream = io.BytesIO()
    savemat(stream, CONTENT, **options)
    return stream.getvalue()


def check(got: Any, want: Any, where: str) -> None:
    """Compare with what scipy reads."""
    if hasattr(want, "_fieldnames"):
        assert set(got) == set(want._fieldnames)
        for name in want._fieldnames:
            check(got[name], getattr(want, name), f"{where}.{name}")
    elif type(want).__name__ == "MatlabOpaque":
        assert got is None
    elif isinstance(got, np.ndarray) and got.dtype != object:
        assert np.size(got) == np.size(want), where
        assert np.array_equal(np.squeeze(got), np.real(np.asarray(want))) or np.size(want) == 0, (
            where
        )
    elif isinstance(got, np.ndarray):
        assert [str(text).rstrip() for text in got.reshape(-1)] == [
            str(text).rstrip() for text in np.atleast_1d(want)
        ], where
    else:
        assert str(got) == str(want), where


@pytest.mark.parametrize(
    "options", [{}, {"do_compression": True}, {"long_field_names": True}, {"oned_as": "column"}]
)
def test_all_that_scipy_writes(options: dict[str, Any]) -> None:
    """Oracle: scipy.io.loadmat of the same file."""
    data = written(**options)
    want = loadmat(io.BytesIO(data), squeeze_me=True, struct_as_record=False)
    got = read_mat(data)
    assert set(got) == set(CONTENT)
    for name in CONTENT:
        check(got[name], want[name], name)


def test_version_4() -> None:
    """Oracle: the matrices that scipy wrote."""
    stream = io.BytesIO()
    savemat(stream, {"a": np.arange(6.0).reshape(2, 3), "b": np.arange(4, dtype="i4")}, format="4")
    got = read_mat(stream.getvalue())
    assert np.array_equal(got["a"], np.arange(6.0).reshape(2, 3))
    assert np.array_equal(got["b"].reshape(-1), np.arange(4))
    with pytest.raises(Damaged, match=r"Not enough bytes to read matrix 'b'"):
        read_mat(stream.getvalue()[:-1])


def test_the_other_byte_order() -> None:
    """Oracle: the elements of the format's description, packed by hand for a big-endian machine."""
    values = struct.pack(">3d", 1.5, 2.5, 3.5)
    parts = (
        struct.pack(">4I", 6, 8, 6, 0)
        + struct.pack(">2I2i", 5, 8, 1, 3)
        + struct.pack(">2H4s", 1, 1, b"x\0\0\0")
        + struct.pack(">2I", 9, 24)
        + values
    )
    data = (
        b"MATLAB 5.0 MAT-file".ljust(124) + b"\1\0MI" + struct.pack(">2I", 14, len(parts)) + parts
    )
    assert read_mat(data)["x"].tolist() == [[1.5, 2.5, 3.5]]


@pytest.mark.parametrize(
    ("offset", "value", "message"),
    [
        (4, 1 << 30, "it ends within an element of 1073741824 bytes"),
        (32, 1 << 20, "a variable of 1048576 x 3 in 72 bytes"),
        (48, 14, "3 values in 24 bytes of type 14"),
        (52, 1 << 30, "it ends within an element of 1073741824 bytes"),
    ],
)
def test_sizes_and_types_that_would_crash_scipy_are_refused(
    offset: int, value: int, message: str
) -> None:
    """Oracle: scipy 1.17, which takes the memory or ends the process; offsets from the first
    variable's tag, as the format has them.
    """
    stream = io.BytesIO()
    savemat(stream, {"a": np.arange(3.0).reshape(1, 3)})
    data = bytearray(stream.getvalue())
    struct.pack_into("<I", data, 128 + offset, value)
    with pytest.raises(Damaged, match=message):
        read_mat(bytes(data))


def test_names_stay_in_their_line() -> None:
    """Oracle: a message is one line, whatever a damaged name holds."""
    assert set(read_mat(written().replace(b"scalar", b"sca\nar"))) >= {"sca?ar"}


@settings(max_examples=60, deadline=None)
@given(st.booleans(), st.data())
def test_every_cut_is_noticed(packed: bool, data: st.DataObject) -> None:
    """Oracle: the bytes that are missing; a cut between variables leaves fewer of them."""
    whole = written(do_compression=packed)
    cut = whole[: data.draw(st.integers(0, len(whole) - 1))]
    with contextlib.suppress(Damaged):
        assert set(read_mat(cut)) < set(CONTENT)


@pytest.mark.parametrize(
    "name",
    [
        "apm_skywalker_x8/SwissLog1.mat",
        "apm_skywalker_x8/TestLog2.mat",
        "hipnuc_car/data20220320_11.mat",
        "umn_thor75/thor_flight75_2012_10_10.mat",
    ],
)
def test_recordings(name: str) -> None:
    """Oracle: scipy.io.loadmat of the same file."""
    if not (DATA / name).exists():
        pytest.skip(f"the recording {name} is not at hand; it is not shipped")
    want = {
        key: value
        for key, value in loadmat(DATA / name, squeeze_me=True, struct_as_record=False).items()
        if key[0] != "_"
    }
    got = read_mat((DATA / name).read_bytes())
    assert set(got) == set(want)
    for key, value in want.items():
        if key not in ("PARM", "flight_info"):  # cells of mixed content, which hold no recording
            check(got[key], value, key)
