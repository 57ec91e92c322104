"""Packed files of every kind: unpacked to what was packed, and no further than the limit.

A bomb of 1.5 MB stands before a limit of 1 MB.
"""

import bz2
import gzip
import io
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

from insgnss.base import unpacking
from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.gnss.rinex.header import TYPES_3, load_rinex, most_restored
from insgnss.gnss.rinex.navigation_message import read_navigation
from insgnss.gnss.rinex.observations import read_observations
from insgnss.io.formats.arrays.matlab import load_matlab
from insgnss.io.formats.arrays.npy import load_numpy
from insgnss.io.formats.blocks.metashape_project import opened_project

SIZE = 1_500_000
TEXT = b"".join(b"%d,%d\n" % (k, k * k % 977) for k in range(20_000))


def zipped(content: bytes, name: str = "doc.xml") -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return stream.getvalue()


def compressed(content: bytes) -> bytes:
    return bytes(pytest.importorskip("ncompress").compress(content))


def saved(content: bytes) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, tow=np.frombuffer(content, np.uint8))
    return stream.getvalue()


def matlab(content: bytes) -> bytes:
    stream = io.BytesIO()
    savemat = pytest.importorskip("scipy.io").savemat
    savemat(stream, {"m": np.frombuffer(content, np.uint8)}, do_compression=True)
    return stream.getvalue()


def hdf5(content: bytes) -> bytes:
    stream = io.BytesIO()
    with pytest.importorskip("h5py").File(stream, "w", userblock_size=512) as file:
        file["m"] = np.frombuffer(content, np.uint8)
    return b"MATLAB 7.3 MAT-file".ljust(512) + stream.getvalue()[512:]


BOMBS = {
    "npz": ("x.npz", saved, load_numpy),
    "mat": ("x.mat", matlab, load_matlab),
    "mat 7.3": ("x.mat", hdf5, load_matlab),
    "psz": ("x.psz", zipped, opened_project),
    "navigation gzip": ("x.nav.gz", gzip.compress, read_navigation),
    "navigation bzip2": ("x.nav.bz2", bz2.compress, read_navigation),
    "observations gzip": ("x.obs.gz", gzip.compress, read_observations),
    "observations compress": ("x.obs.Z", compressed, read_observations),
    "observations zip": ("x.zip", zipped, read_observations),
}


@pytest.mark.parametrize("kind", BOMBS)
def test_a_bomb_is_refused_in_one_line_with_the_limit_and_how_to_raise_it(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the sizes, and the memory that Python took meanwhile."""
    name, pack, read = BOMBS[kind]
    path = tmp_path / name
    path.write_bytes(pack(bytes(SIZE)))
    monkeypatch.setenv(unpacking.UNPACKED_GB, "0.001")
    tracemalloc.start()
    with pytest.raises(InputError, match=r"(?s)^[^\n]*unpacks to .*INSGNSS_UNPACKED_GB=1 in") as no:
        read(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "(limit 1 MB)" in str(no.value)
    assert kind == "mat 7.3" or peak < 3.0e6  # beside h5py's modules
    monkeypatch.setenv(unpacking.UNPACKED_GB, "1")
    refusals = []
    try:
        read(path)
    except InputError as other:  # zeros are no recording, but they are unpacked
        refusals = [str(other)]
    assert not any("unpacks" in text for text in refusals)


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress, compressed, zipped])
def test_what_was_packed_comes_back(pack: object) -> None:
    """Oracle: the text before it was packed; also where it is far smaller than usual."""
    for content in (TEXT, b"", bytes(SIZE)):
        assert unpacking.unpack("x", pack(content)) == content  # type: ignore[operator]
    if pack is not zipped and pack is not compressed:  # streams may stand one behind the other
        assert unpacking.unpack("x", pack(TEXT) + pack(b"end")) == TEXT + b"end"  # type: ignore[operator]


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress, zipped])
def test_what_is_cut_is_refused(pack: object) -> None:
    """Oracle: every cut, and bytes behind the end."""
    whole = pack(TEXT[:100])  # type: ignore[operator]
    for size in range(4, len(whole)):
        with pytest.raises(InputError, match=r"^x: cannot be unpacked: .*; copy it again"):
            unpacking.unpack("x", whole[:size])
    if pack is not zipped:
        with pytest.raises(InputError, match="bytes that do not belong to the file"):
            unpacking.unpack("x", whole + b"more")


def test_what_memory_does_not_hold_is_no_fault_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: 1 MB left for 1.5 MB: exit code 4, not 3."""
    monkeypatch.setattr(unpacking, "available", lambda: 1_000_000)
    for pack in (zipped, gzip.compress):
        with pytest.raises(DataError, match=r"unpacks to .*1\.?5? MB, and memory has 1 MB left"):
            unpacking.unpack("x", pack(bytes(SIZE)))


@pytest.mark.parametrize("value", ["all", "-1", "nan"])
def test_a_limit_that_is_none_is_wrong_use(value: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(unpacking.UNPACKED_GB, value)
    with pytest.raises(UsageError, match=rf"INSGNSS_UNPACKED_GB = '{value}': a number of GB"):
        unpacking.unpacked_limit()


def test_compact_rinex_restores_to_no_more_than_was_foreseen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the program of Hatanaka itself, on its worst file: nothing changes between epochs."""
    hatanaka = pytest.importorskip("hatanaka")
    head = (
        f"{'     3.04           OBSERVATION DATA    G':60}RINEX VERSION / TYPE\n"
        f"{'G   20 C1C L1C D1C S1C C2W L2W D2W S2W C5Q L5Q D5Q S5Q C1W':60}{TYPES_3}\n"
        f"{'       L1W D1W S1W C2L L2L D2L S2L':60}{TYPES_3}\n"
        f"{'':60}END OF HEADER\n"
    )
    row = "".join(f"{20000000.0 + k:14.3f}  " for k in range(20)).rstrip()
    epochs = "".join(
        f"> 2018 07 03 00 {k // 60:02d} {k % 60:2d}.0000000  0 10\n"
        + "".join(f"G{n:02d}{row}\n" for n in range(1, 11))
        for k in range(200)
    )
    content = hatanaka.rnx2crx((head + epochs).encode())
    restored = hatanaka.crx2rnx(content)
    assert len(restored) > 7 * len(content)
    assert len(restored) < most_restored(content) < 2.0 * len(restored)
    path = tmp_path / "x.crx"
    path.write_bytes(content)
    assert bytes(load_rinex(path)[0]) == restored
    monkeypatch.setenv(unpacking.UNPACKED_GB, "0.0005")
    with pytest.raises(InputError, match=r"unpacks to up to .* \(limit 0\.5 MB\)"):
        load_rinex(path)
