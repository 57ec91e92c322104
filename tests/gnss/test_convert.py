"""Receivers' own logs, converted to RINEX by RTKLIB."""

import gzip
import runpy
from pathlib import Path

import numpy as np
import pytest
from oracles import oracle

from insgnss.base.errors import DataError, InputError
from insgnss.gnss.engine import convert as room
from insgnss.gnss.engine.convert import convert_log, log_format
from insgnss.gnss.rinex.observations import read_observations
from insgnss.io.formats.logs.ulog import receiver_bytes

DATA = Path(__file__).parents[3] / "shared" / "data"


def ubx(payload: bytes) -> bytes:
    """A frame of u-blox, without a true checksum."""
    return b"\xb5\x62\x02\x15" + len(payload).to_bytes(2, "little") + payload + b"\0\0"


def rtcm(payload: bytes) -> bytes:
    """A frame of RTCM 3, without a true checksum."""
    return b"\xd3" + len(payload).to_bytes(2, "big") + payload + b"\0\0\0"


@pytest.mark.parametrize(
    ("content", "form"),
    [
        (ubx(b"abc") + ubx(b"") + ubx(b"\xd3" * 40), "UBX"),
        (b"$GNRMC,1*00\r\n" + ubx(b"abc") * 3, "UBX"),
        (rtcm(b"abc") + rtcm(b"") + rtcm(b"x" * 300), "RTCM3"),
        (b"$@abcd" * 4, "SEPT"),
        (rtcm(b"abc") * 2, ""),
        (b"     3.04           OBSERVATION DATA\n", ""),
    ],
)
def test_first_bytes_tell_a_log(tmp_path, content, form):
    """Oracle: frames by hand, as the interface documents have them."""
    (tmp_path / "x.log").write_bytes(content)
    assert log_format(tmp_path / "x.log") == form


def test_without_the_converter_one_line_says_how_to_get_it(tmp_path, monkeypatch):
    """Oracle: the line; a file of RINEX needs none."""
    monkeypatch.setattr(room.importlib.util, "find_spec", lambda name: None)
    (tmp_path / "x.ubx").write_bytes(ubx(b"abc") * 3)
    with pytest.raises(InputError, match=r"log of u-blox; .* pip install .*\[ppk\]"):
        convert_log(tmp_path / "x.ubx", tmp_path, ())
    (tmp_path / "x.obs").write_text("RINEX\n")
    assert convert_log(tmp_path / "x.obs", tmp_path, ()).path == tmp_path / "x.obs"


def px4(path, rows):
    """A log of PX4 that holds bytes to (128) and from its receivers: instance, direction, bytes."""
    oracle("pyulog")
    fields = "uint64_t timestamp; uint8_t instance; uint8_t len; uint8_t[79] data"
    dump = [
        (1_000_000 + k, instance, len(data) + way, *data.ljust(79, b"\0"))
        for k, (instance, way, data) in enumerate(rows)
    ]
    writer = runpy.run_path(str(Path(__file__).parents[2] / "scripts/fuzz_readers.py"))
    path.write_bytes(writer["ulog"]([("gps_dump", fields, dump)])[0])
    return path


@pytest.mark.slow
def test_a_log_of_px4_holds_that_of_its_receiver(tmp_path, monkeypatch):
    """Oracle: the bytes put in, without those to the receiver and of another one, as pyulog's own
    extraction has them; they reach the converter as a log of u-blox."""
    frames = b"".join(ubx(bytes([k]) * 90) for k in range(5))
    pieces = [frames[k : k + 79] for k in range(0, len(frames), 79)]
    rows = [row for piece in pieces for row in ((0, 0, piece), (0, 128, b"to"), (1, 0, b"other"))]
    path = px4(tmp_path / "flight.ulg", rows)
    assert receiver_bytes(path) == frames
    assert log_format(path) == "ULOG"
    commands = []
    monkeypatch.setattr(room.importlib.util, "find_spec", lambda name: True)
    monkeypatch.setattr(room, "_run", lambda command, path: commands.append(command))
    with pytest.raises(DataError, match="u-blox: the converter found no raw observations"):
        convert_log(path, tmp_path / "out", ())
    ((*_, form, source, _, _),) = commands
    assert (form, Path(source).read_bytes()) == ("UBX", frames)
    with pytest.raises(DataError, match=r"holds no messages of its receiver .*GPS_DUMP_COMM"):
        convert_log(px4(tmp_path / "none.ulg", [(0, 128, b"to")]), tmp_path / "out", ())


@pytest.mark.slow
def test_a_recorded_log_of_ublox(tmp_path):
    """Oracle: RINEX of the same recording by another version of the converter."""
    pytest.importorskip("pyrtklib5")
    place = DATA / "rinex_ublox_2018"
    if not place.is_dir():
        pytest.skip("the recording rinex_ublox_2018 is not here")
    log = tmp_path / "rover.ubx"
    log.write_bytes(gzip.decompress((place / "rover-20181004-1532.ubx.gz").read_bytes()))
    one = convert_log(log, tmp_path / "out", ())
    ours, theirs = (read_observations(p) for p in (one.path, place / "rover-20181004-1532.obs"))
    assert one.checks[0].found == "rover.ubx is of u-blox: 1180 epochs as RINEX 3.04"
    np.testing.assert_allclose(ours.time, theirs.time, atol=1e-6)
    both = min(ours.values.shape[0], theirs.values.shape[0])
    assert both > 0.99 * max(ours.values.shape[0], theirs.values.shape[0])


@pytest.mark.slow
def test_a_recorded_stream_of_rtcm_is_of_its_week(tmp_path):
    """Oracle: RINEX of the same recording, for which a person gave the day."""
    pytest.importorskip("pyrtklib5")
    place = DATA / "dji_p4rtk"
    if not place.is_dir():
        pytest.skip("the recording dji_p4rtk is not here")
    navigation = (place / "DERIVED_rover_incomplete.nav",)
    one = convert_log(place / "100_0004_PPKRAW.bin", tmp_path, navigation)
    ours, theirs = (read_observations(p) for p in (one.path, place / "DERIVED_rover.obs.gz"))
    assert ours.gps_week == theirs.gps_week == 2024
    np.testing.assert_allclose(ours.time, theirs.time, atol=1e-6)
