"""Logs of ArduPilot and PX4: small true logs, read back here and by the libraries of the two
projects.
"""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from oracles import oracle

from insgnss.base.errors import InputError, UsageError
from insgnss.io.formats import describe, read_barometer, read_events, read_gnss, read_imu
from insgnss.io.formats.logs.boot_clock import fit_clock


def script() -> ModuleType:
    """The fuzzer's module, which writes the logs."""
    spec = importlib.util.spec_from_file_location(
        "fuzz_readers", Path(__file__).parents[3] / "scripts/fuzz_readers.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["fuzz_readers"] = module
    spec.loader.exec_module(module)
    return module


WRITER = script()
START = WRITER.START
LATE = 0.1  # s, of the messages of fixes in both logs


@pytest.fixture
def bin_log(tmp_path: Path) -> Path:
    oracle("pymavlink")
    (tmp_path / "x.bin").write_bytes(WRITER.ardupilot_log(24)[0])
    return tmp_path / "x.bin"


@pytest.fixture
def ulg_log(tmp_path: Path) -> Path:
    oracle("pyulog")
    (tmp_path / "x.ulg").write_bytes(WRITER.px4_log(24)[0])
    return tmp_path / "x.ulg"


def by_pymavlink(path: Path, name: str) -> dict[str, np.ndarray]:
    from pymavlink.DFReader import DFReader_binary

    rows: list[dict[str, Any]] = []
    with DFReader_binary(str(path)) as log:
        while (message := log.recv_match(type=name)) is not None:
            rows.append(message.to_dict())
    return {
        label: np.array([row[label] for row in rows])
        for label in rows[0]
        if label != "mavpackettype"
    }


def test_ardupilot_log_as_pymavlink_reads_it(bin_log: Path) -> None:
    """Oracle: pymavlink, message by message; the times that the log was written with, a latency of
    0.1 s in the clock's offset.
    """
    imu, gnss, events = (
        read_imu(bin_log, quantity="instant_rate"),
        read_gnss(bin_log),
        read_events(bin_log),
    )
    raw = by_pymavlink(bin_log, "IMU")
    assert np.array_equal(imu.gyro, np.column_stack([raw[f"Gyr{c}"] for c in "XYZ"]))
    assert np.array_equal(imu.accel, np.column_stack([raw[f"Acc{c}"] for c in "XYZ"]))
    assert_allclose(
        imu.time, START + 1e-6 * raw["TimeUS"] - LATE, rtol=0, atol=1e-3
    )  # GMS is in whole milliseconds
    raw, gpa = by_pymavlink(bin_log, "GPS"), by_pymavlink(bin_log, "GPA")
    assert_allclose(np.degrees(gnss.lat), raw["Lat"], rtol=1e-15)
    assert_allclose(gnss.height, raw["Alt"] - gpa["Und"], rtol=1e-12)
    assert_allclose(gnss.time, raw["GMS"] * 1e-3, rtol=1e-15)
    assert_allclose(
        np.sqrt(np.diagonal(gnss.cov_ned, axis1=1, axis2=2)),
        np.column_stack([gpa["HAcc"], gpa["HAcc"], gpa["VAcc"]]),
        rtol=1e-12,
    )
    assert gnss.velocity_ned is not None
    assert_allclose(gnss.velocity_ned[0], [0.0, 10.0, 0.1], atol=1e-6)
    assert gnss.quality is not None
    assert set(gnss.quality.tolist()) == {5}
    raw = by_pymavlink(bin_log, "CAM")
    assert events.images == tuple(str(k) for k in raw["Img"])
    assert_allclose(events.time, START + 1e-6 * raw["TimeUS"] - LATE, rtol=0, atol=1e-3)
    assert {imu.gps_week, gnss.gps_week, events.gps_week} == {2008}
    assert {table.name for table in describe(bin_log)} == {"IMU", "GPS", "GPA", "BARO", "CAM"}


def test_px4_log_as_pyulog_reads_it(ulg_log: Path) -> None:
    """Oracle: pyulog; the times that the log was written with, a latency of 0.1 s in the clock's
    offset.
    """
    from pyulog import ULog

    raw = {topic.name: topic.data for topic in ULog(str(ulg_log)).data_list}
    imu, gnss, events = read_imu(ulg_log), read_gnss(ulg_log), read_events(ulg_log)
    assert np.array_equal(
        imu.gyro, np.column_stack([raw["sensor_combined"][f"gyro_rad[{k}]"] for k in range(3)])
    )
    assert_allclose(
        imu.time, START + 1e-6 * raw["sensor_combined"]["timestamp"] - LATE, rtol=0, atol=2e-6
    )
    fixes = raw["vehicle_gps_position"]
    assert_allclose(np.degrees(gnss.lat), fixes["lat"] * 1e-7, rtol=1e-15)
    assert_allclose(gnss.height, fixes["alt_ellipsoid"] * 1e-3, rtol=1e-15)
    assert_allclose(gnss.time, START + 1e-6 * fixes["timestamp"] - LATE, rtol=0, atol=2e-6)
    assert_allclose(np.sqrt(gnss.cov_ned[:, 2, 2]), fixes["epv"], rtol=1e-7)
    assert gnss.velocity_ned is not None
    assert_allclose(gnss.velocity_ned[:, 2], fixes["vel_d_m_s"], rtol=1e-15)
    assert events.images == tuple(str(k) for k in raw["camera_capture"]["seq"])
    assert_allclose(
        events.time, START + 1e-6 * raw["camera_capture"]["timestamp"] - LATE, rtol=0, atol=2e-6
    )
    assert {imu.gps_week, gnss.gps_week, events.gps_week} == {2008}


@pytest.mark.parametrize("kind", ["bin_log", "ulg_log"])
def test_barometer_of_a_log(kind: str, request: pytest.FixtureRequest) -> None:
    """Oracle: ISO 2533's table at 1000 m, 89874.6 Pa, which is the first pressure of the logs, and
    1.1117 kg/m^3, so that 1 Pa less, as at each message, is 0.0917 m more; the stamps that the logs
    are written with, of PX4 8 ms before those of the message.
    """
    path = request.getfixturevalue(kind)
    heights = read_barometer(path)
    begin = START + 1.0 - LATE - (0.008 if kind == "ulg_log" else 0.0)
    assert_allclose(heights.time, begin + 0.2 * np.arange(24), rtol=0, atol=1e-3)
    assert heights.height[0] == pytest.approx(1000.0, abs=0.05)
    assert_allclose(np.diff(heights.height), 0.0917, rtol=0, atol=1e-3)
    assert heights.gps_week == 2008
    assert any("relate its clock to GPST" in note.found for note in heights.notes)
    with pytest.raises(InputError, match="GPS week 2008"):
        read_barometer(path, gps_week=2000)
    with pytest.raises(InputError, match=r"no (message|topic) NONE"):
        read_barometer(path, variable="NONE")


def test_height_of_an_autopilot_where_it_logs_no_pressure(tmp_path: Path) -> None:
    """Oracle: the heights of the log's BARO lines."""
    log = (
        "FMT, 130, 50, GPS, QBIH, TimeUS,Status,GMS,GWk,Lat,Lng,Alt\n"
        "FMT, 131, 20, BARO, Qf, TimeUS,Alt\n"
        "GPS, 1200000, 3, 200001000, 2008, 46.57, 6.54, 580.5\n"
        "BARO, 1210000, 12.5\nBARO, 1310000, 12.75\n"
    )
    (tmp_path / "x.log").write_text(log)
    heights = read_barometer(tmp_path / "x.log")
    assert heights.height.tolist() == [12.5, 12.75]
    assert heights.time.tolist() == pytest.approx([200001.01, 200001.11])


@pytest.mark.parametrize("kind", ["bin_log", "ulg_log"])
def test_cut_log_is_told(kind: str, request: pytest.FixtureRequest) -> None:
    """Oracle: the messages up to the cut, which falls into the last one of the file."""
    path = request.getfixturevalue(kind)
    whole = read_imu(path, quantity="instant_rate")
    path.write_bytes(path.read_bytes()[:-3])
    cut = read_imu(path, quantity="instant_rate")
    assert any("the file ends within a message" in note.found for note in cut.notes)
    assert whole.time.size - cut.time.size in (0, 1)
    assert not any("within a message" in note.found for note in whole.notes)


def test_damage_is_counted_and_limited(bin_log: Path) -> None:
    """Oracle: 7 strange bytes between two messages, then 2 % of the file."""
    data, borders = WRITER.ardupilot_log(24)
    at = sorted(borders)[40]
    bin_log.write_bytes(data[:at] + b"garbage" + data[at:])
    assert any(
        "7 bytes that belong to no message left out" in note.found
        for note in read_imu(bin_log, quantity="instant_rate").notes
    )
    bin_log.write_bytes(data[:at] + bytes(len(data) // 45) + data[at:])
    with pytest.raises(InputError, match=r"bytes belong to no message \(limit 1%\)"):
        read_imu(bin_log, quantity="instant_rate")
    bin_log.write_bytes(data[:4] + b"\0" + data[5:])
    with pytest.raises(InputError, match="is no ArduPilot log"):
        read_imu(bin_log, quantity="instant_rate")


def test_text_log_with_other_sensors(tmp_path: Path) -> None:
    """Oracle: the lines as a person reads them; TimeMS and T of older logs."""
    head = (
        "FMT, 129, 31, IMU, QBffffff, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ\nFMT, 130, 9, GPS,"
        " BIHLLeI, Status,TimeMS,Week,Lat,Lng,Alt,T\n"
    )
    rows = [
        f"GPS, {2 + (k > 1)}, {1000 * k + 200}, 2008, 46.57, 6.54, 580.5, {1000 * k}\n"
        for k in range(1, 6)
    ]
    rows += [
        f"IMU, {10000 * k}, {i}, {i}.5, 0, 0, 0, 0, -9.8\n" for k in range(100, 200) for i in (0, 1)
    ]
    (tmp_path / "x.log").write_text(head + "".join(rows))
    first, second = (
        read_imu(tmp_path / "x.log", variable=name, quantity="instant_rate")
        for name in ("IMU", "IMU2")
    )
    assert (first.gyro[0, 0], second.gyro[0, 0]) == (0.5, 1.5)
    assert_allclose(first.time, 0.2 + 0.01 * np.arange(100, 200), rtol=0, atol=1e-9)
    gnss = read_gnss(tmp_path / "x.log", sigma_m=[2, 2, 4], undulation_m=49.5)
    assert gnss.time.tolist() == [2.2, 3.2, 4.2, 5.2]
    assert gnss.height[0] == 630.0
    assert "1 messages without a fix left out" in gnss.notes[0].found
    assert any(
        "above the geoid" in note.found
        for note in read_gnss(tmp_path / "x.log", sigma_m=[2, 2, 4]).notes
    )
    with pytest.raises(InputError, match="no message CAM or TRIG; there are GPS, IMU, IMU2"):
        read_events(tmp_path / "x.log")
    with pytest.raises(UsageError, match="holds rates"):
        read_imu(tmp_path / "x.log", quantity="increments")
    with pytest.raises(InputError, match="no standard deviations"):
        read_gnss(tmp_path / "x.log")


def test_raw_gyros_and_accelerometers_are_brought_together(tmp_path: Path) -> None:
    """Oracle: a straight line in time, which interpolation keeps."""
    head = (
        "FMT, 129, 9, GYR, QBQfff, TimeUS,I,SampleUS,GyrX,GyrY,GyrZ\nFMT, 130, 9, ACC, QBQfff,"
        " TimeUS,I,SampleUS,AccX,AccY,AccZ\n"
    )
    head += "FMT, 131, 9, GPS, QBIHLLe, TimeUS,Status,GMS,GWk,Lat,Lng,Alt\n"
    rows = [f"GYR, 0, 0, {1000000 + 1000 * k}, {k}, 0, 0\n" for k in range(100)]
    rows += [f"ACC, 0, 0, {1000300 + 900 * k}, {0.3 + 0.9 * k:.1f}, 0, -9.8\n" for k in range(100)]
    rows += [f"GPS, {10**6 * k}, 3, {1000 * k + 500}, 2008, 46.5, 6.5, 600\n" for k in range(1, 4)]
    (tmp_path / "x.log").write_text(head + "".join(rows))
    imu = read_imu(tmp_path / "x.log", quantity="instant_rate")
    assert_allclose(imu.accel[:, 0], imu.gyro[:, 0], rtol=0, atol=1e-9)
    assert_allclose(imu.time, 1.5 + 0.001 * imu.gyro[:, 0], rtol=0, atol=1e-6)
    assert (imu.gyro[0, 0], imu.gyro[-1, 0]) == (1.0, 89.0)
    assert any("ACC interpolated to the stamps of GYR" in note.found for note in imu.notes)


@pytest.mark.parametrize(
    ("library", "kind"), [("pymavlink.DFReader", "bin_log"), ("pyulog", "ulg_log")]
)
def test_missing_library_is_told_in_one_line(
    library: str, kind: str, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the way out that the specification names."""
    path = request.getfixturevalue(kind)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(InputError, match=r"is not installed: pip install 'insgnss\[logs\]'"):
        read_gnss(path)


def test_clock_with_drift_and_late_messages() -> None:
    """Oracle: the clock that the stamps were made with; 80 to 300 ms of latency, 40 ppm of drift, 2
    % of messages a second late.
    """
    rng = np.random.default_rng(5)
    gps = 604000.0 + 0.2 * np.arange(6000)
    late = rng.uniform(0.08, 0.3, gps.size) + (rng.random(gps.size) < 0.02)
    boot = (gps + late - 603990.0) * (1.0 - 40e-6)
    clock = fit_clock("x", boot, np.full(gps.size, 2008.0), gps)
    assert clock.drift == pytest.approx(40e-6, abs=10e-6)
    at = np.array([700.0, 1200.0])
    truth = at / (1.0 - 40e-6) + 603990.0
    assert_allclose(clock.gpst(None, at), truth - 0.19, rtol=0, atol=0.01)  # type: ignore[arg-type]
    steep = fit_clock("x", boot * 1.1, np.full(gps.size, 2008.0), gps)
    assert_allclose(steep.gpst(None, at * 1.1), truth - 0.19, rtol=0, atol=0.01)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="no GNSS fix with a GPS time"):
        fit_clock("x", boot[:0], gps[:0], gps[:0])


@pytest.mark.parametrize(
    ("ppm", "late_s", "step_s", "fine"),
    [
        (480, 0.0, 0.0, True),
        (-83267, 0.3, 0.0, True),
        (0, 0.9, 0.0, True),
        (0, 1.1, 0.0, False),
        (0, 0.0, 2.0, False),
        (83267, 0.3, -2.0, False),
    ],
)
def test_limits_of_an_autopilots_clock(
    ppm: float, late_s: float, step_s: float, fine: bool
) -> None:
    """Oracle: the slope that the stamps are made with, and the limits that the refusal names, a
    spread of 1 s and a step of 0.2 s; late: two of three messages, one to either side; the clock is
    set at two thirds of the log.
    """
    gps = 604000.0 + 0.2 * np.arange(3000)
    boot = (gps + late_s * np.tile([-1.0, 0.0, 1.0], 1000) - 603990.0) / (1.0 + 1e-6 * ppm)
    boot[2000:] += step_s
    week = np.full(gps.size, 2008.0)
    if fine:
        assert fit_clock("x", boot, week, gps).drift == pytest.approx(1e-6 * ppm, abs=5e-6)
    else:
        with pytest.raises(InputError, match=r"\(limit 1 s\), step .*\(limit 0.2 s\)"):
            fit_clock("x", boot, week, gps)


def test_height_above_the_ellipsoid_of_newer_firmware(tmp_path: Path) -> None:
    """Oracle: AEl of the log, and the heights above the geoid, with the note, where one fix has
    -2^31 cm in its place, which the firmware writes for none.
    """
    head = (
        "FMT, 130, 50, GPS, QBIHLLe, TimeUS,Status,GMS,GWk,Lat,Lng,Alt\n"
        "FMT, 131, 31, GPA, QCCCe, TimeUS,HAcc,VAcc,SAcc,AEl\n"
    )
    fixes = [
        f"GPS, {10**6 * k}, 3, {1000 * k}, 2008, 46.57, 6.54, 580.5\n"
        f"GPA, {10**6 * k}, 0, 0.03, 0.05, {{}}\n"
        for k in range(1, 4)
    ]
    log = head + "".join(fixes)
    (tmp_path / "x.log").write_text(log.format(630.25, 630.5, 630.75))
    gnss = read_gnss(tmp_path / "x.log", sigma_m=[2, 2, 4])
    assert gnss.height.tolist() == [630.25, 630.5, 630.75]
    assert not any("geoid" in note.found for note in gnss.notes)
    (tmp_path / "x.log").write_text(log.format(630.25, -21474836.48, 630.75))
    gnss = read_gnss(tmp_path / "x.log", sigma_m=[2, 2, 4])
    assert gnss.height.tolist() == [580.5] * 3
    assert any("heights are above the geoid" in note.found for note in gnss.notes)


def test_vehicle_imu_gives_rates_over_its_own_intervals(tmp_path: Path) -> None:
    """Oracle: increments divided by their intervals, by hand."""
    oracle("pyulog")
    unix = 315964800 + 2008 * 604800 + 200000 - 18
    fields = (
        "uint64_t timestamp; uint64_t timestamp_sample; float[3] delta_angle; float[3]"
        " delta_velocity; "
    )
    fields += "uint32_t delta_angle_dt; uint32_t delta_velocity_dt"
    imu = [
        (10000 * k, 10000 * k - 500, 0.01, 0.0, -0.02, 0.1, 0.0, -0.5, 5000, 4000)
        for k in range(1, 50)
    ]
    gps = [
        (200000 * k, unix * 10**6 + 200000 * k, 46.5, 6.5, 600.0, 6, 0.02, 0.03)
        for k in range(1, 5)
    ]
    more = "uint64_t timestamp; uint64_t time_utc_usec; double latitude_deg; double longitude_deg; "
    more += "double altitude_ellipsoid_m; uint8_t fix_type; float eph; float epv"
    (tmp_path / "x.ulg").write_bytes(
        WRITER.ulog([("vehicle_imu", fields, imu), ("sensor_gps", more, gps)])[0]
    )
    got, fixes = read_imu(tmp_path / "x.ulg"), read_gnss(tmp_path / "x.ulg")
    assert_allclose(got.gyro[0], [2.0, 0.0, -4.0], rtol=1e-6)
    assert_allclose(got.accel[0], [25.0, 0.0, -125.0], rtol=1e-6)
    assert_allclose(got.time, 200000.0 + 0.01 * np.arange(1, 50) - 0.0005, rtol=0, atol=2e-6)
    assert np.degrees(fixes.lat[0]) == pytest.approx(46.5, abs=1e-12)
    assert fixes.quality is not None
    assert set(fixes.quality.tolist()) == {1}
    with pytest.raises(
        InputError,
        match="no topic camera_capture or camera_trigger; there are sensor_gps, vehicle_imu",
    ):
        read_events(tmp_path / "x.ulg")


@pytest.mark.parametrize("status", [None, 1])
def test_a_log_without_fixes_keeps_the_autopilot_clock(tmp_path: Path, status: int | None) -> None:
    """Oracle: the stamps put in, without a week; positions are refused, with what to give."""
    lines = ["FMT, 130, 30, IMU, QBffffff, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"]
    lines += ["FMT, 131, 30, GPS, QBBIHLLf, TimeUS,I,Status,GMS,GWk,Lat,Lng,Alt"]
    lines += [f"IMU, {5_000_000 + 20_000 * k}, 0, 0.01, 0, 0, 0, 0, -9.8" for k in range(50)]
    if status is not None:
        lines += [f"GPS, {5_000_000 + 200_000 * k}, 0, {status}, 0, 0, 0, 0, 0" for k in range(5)]
    path = tmp_path / "bench.log"
    path.write_text("\n".join(lines) + "\n")
    imu = read_imu(path)
    assert_allclose(imu.time, 5.0 + 0.02 * np.arange(50))
    assert imu.gps_week is None
    assert any("no GNSS fix in the log" in note.found for note in imu.notes)
    with pytest.raises(
        InputError, match=r"no message GPS|give the GNSS positions in a separate file"
    ):
        read_gnss(path)
