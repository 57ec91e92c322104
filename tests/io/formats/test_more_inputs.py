"""SBET as an input, PSINS and ODyN files, and what NMEA says of velocity and date."""

from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError
from insgnss.geodesy.gpstime import WEEK_S
from insgnss.geodesy.rotation import rotation_from_rpy, rpy_jacobian
from insgnss.io.formats import read_events, read_gnss, read_imu
from insgnss.io.formats.imu.psins import read_psins_header
from insgnss.io.formats.trajectory.odyn import read_odyn_poses
from insgnss.io.formats.trajectory.sbet import (
    read_sbet,
    read_smrmsg,
    smrmsg_beside,
    write_sbet,
    write_smrmsg,
)
from insgnss.records import GnssFixes, Trajectory

DATA = Path(__file__).parents[3].parent / "shared" / "data"
ARC_MINUTE = np.pi / 10800.0


def trajectory(n: int = 20) -> Trajectory:
    rng = np.random.default_rng(4)
    rpy = np.radians(rng.uniform([-30, -20, -180], [30, 20, 180], (n, 3)))
    A = rng.normal(size=(n, 9, 9))
    cov = 1e-6 * (A @ np.swapaxes(A, 1, 2) + np.eye(9))
    time, lat = 2e5 + 0.05 * np.arange(n), np.full(n, 0.8) + 1e-7 * np.arange(n)
    return Trajectory(
        time,
        lat,
        np.full(n, 0.1),
        np.full(n, 600.0),
        rng.normal(size=(n, 3)),
        rotation_from_rpy(rpy),
        cov,
        2008,
    )


@pytest.mark.parametrize(
    "names", [("x.sbet", "x.smrmsg"), ("sbet_Mission 1.out", "smrmsg_Mission 1.out")]
)
def test_sbet_with_its_accuracies(tmp_path: Path, names: tuple[str, str]) -> None:
    """Oracle: the trajectory that was written; its standard deviations of position, velocity, and
    of roll pitch heading.
    """
    given = trajectory()
    write_sbet(given, tmp_path / names[0])
    write_smrmsg(given, tmp_path / names[1])
    assert smrmsg_beside(tmp_path / names[0]) == tmp_path / names[1]
    fixes = read_gnss(tmp_path / names[0], gps_week=2008)
    assert fixes.velocity_ned is not None
    assert fixes.velocity_cov_ned is not None
    assert_allclose(fixes.velocity_ned, given.velocity_ned, rtol=1e-13)
    sigma = np.sqrt(np.diagonal(given.cov, axis1=1, axis2=2))
    assert_allclose(np.sqrt(np.diagonal(fixes.cov_ned, axis1=1, axis2=2)), sigma[:, :3], rtol=1e-13)
    assert_allclose(
        np.sqrt(np.diagonal(fixes.velocity_cov_ned, axis1=1, axis2=2)), sigma[:, 3:6], rtol=1e-13
    )
    back = read_sbet(tmp_path / names[0])
    assert_allclose(back.C_nb, given.C_nb, rtol=0, atol=1e-14)
    # roll pitch heading of diagonal covariances come out as they went in
    E, cov = rpy_jacobian(back.rpy), given.cov.copy()
    variance = read_smrmsg(tmp_path / names[1]).sigma_rpy ** 2
    cov[:, 6:, 6:] = np.einsum("nij,nj,nkj->nik", E, variance, E)
    write_smrmsg(replace(given, cov=cov), tmp_path / "again.smrmsg")
    again, before = (
        np.fromfile(path).reshape(-1, 10)
        for path in (tmp_path / "again.smrmsg", tmp_path / names[1])
    )
    assert_allclose(again, before, rtol=1e-12)


def test_sbet_and_its_accuracies_count_on_over_a_weeks_end(tmp_path: Path) -> None:
    """Oracle: the same records of the middle of a week, shifted; times begin anew at its end."""
    given, names = trajectory(), ("x.sbet", "x.smrmsg")
    for write, name, fields in zip((write_sbet, write_smrmsg), names, (17, 10), strict=True):
        write(given, tmp_path / name)
        records = np.fromfile(tmp_path / name).reshape(-1, fields)
        records[:, 0] = (given.time - given.time[9] + WEEK_S) % WEEK_S
        records.tofile(tmp_path / name)
    expected = given.time - given.time[9] + WEEK_S
    assert_allclose(read_sbet(tmp_path / "x.sbet").time, expected, rtol=0, atol=1e-9)
    fixes = read_gnss(tmp_path / "x.sbet")
    assert_allclose(fixes.time, expected, rtol=0, atol=1e-9)
    sigma = np.sqrt(np.diagonal(given.cov, axis1=1, axis2=2))[:, :3]
    assert_allclose(np.sqrt(np.diagonal(fixes.cov_ned, axis1=1, axis2=2)), sigma, rtol=1e-9)


def test_sparse_accuracies_are_interpolated_and_foreign_ones_refused(tmp_path: Path) -> None:
    """Oracle: numpy.interp of every fifth record; another run's times."""
    given = trajectory(21)
    write_sbet(given, tmp_path / "x.sbet")
    write_smrmsg(given, tmp_path / "x.smrmsg")
    rms = np.fromfile(tmp_path / "x.smrmsg").reshape(-1, 10)
    rms[::5].tofile(tmp_path / "x.smrmsg")
    fixes = read_gnss(tmp_path / "x.sbet")
    assert_allclose(
        np.sqrt(fixes.cov_ned[:, 2, 2]), np.interp(given.time, rms[::5, 0], rms[::5, 3]), rtol=1e-13
    )
    (rms + [100.0, *[0.0] * 9]).tofile(tmp_path / "x.smrmsg")
    with pytest.raises(InputError, match=r"exceed them by 100.000 s \(limit 1.5 s\)"):
        read_gnss(tmp_path / "x.sbet")
    (rms * [1.0, -1.0, *[1.0] * 8]).tofile(tmp_path / "x.smrmsg")
    with pytest.raises(InputError, match="record 1: a standard deviation is not positive"):
        read_gnss(tmp_path / "x.sbet")


def test_sbet_alone_takes_the_callers_sigma(tmp_path: Path) -> None:
    """Oracle: the standard deviations given."""
    write_sbet(trajectory(), tmp_path / "x.sbet")
    fixes = read_gnss(tmp_path / "x.sbet", sigma_m=[1, 2, 3])
    assert_allclose(fixes.cov_ned[0], np.diag([1, 4, 9]))
    assert fixes.velocity_ned is None
    assert (
        read_gnss(tmp_path / "x.sbet", sigma_m=[1, 2, 3], sigma_velocity=[1, 1, 1]).velocity_ned
        is not None
    )
    with pytest.raises(InputError, match="no standard deviations"):
        read_gnss(tmp_path / "x.sbet")
    (tmp_path / "x.sbet").write_bytes((tmp_path / "x.sbet").read_bytes()[:-1])
    with pytest.raises(InputError, match="no whole number of records"):
        read_gnss(tmp_path / "x.sbet", sigma_m=[1, 2, 3])


PSINS = """% PSINS-format SIMU log file.
% "X-Right,Y-Foward,Z-Up"
1.0 2.0 -90.6 0.1 0.2 0.3
34.246048 108.909664 380.0 5.0 10.0 9.780327
0.1 0.2 0.3 100.0 110.0 120.0
1 2 3 4 5 6
-1 -2 -3 -4 -5 -6
"""


def test_psins_counts_and_header(tmp_path: Path) -> None:
    """Oracle: arcsec and ug s by hand; yaw positive to the west is heading with the other sign."""
    (tmp_path / "x.imu").write_text(PSINS)
    imu = read_imu(tmp_path / "x.imu", quantity="increments")
    assert_allclose(imu.time, [5.01, 5.02], rtol=1e-15)
    assert_allclose(np.degrees(imu.gyro[0]) * 3600, [0.1, 0.4, 0.9], rtol=1e-13)
    assert_allclose(imu.accel[1] / 9.780327e-6, [-400, -550, -720], rtol=1e-13)
    assert_allclose(
        read_imu(tmp_path / "x.imu", quantity="mean_rate").gyro, imu.gyro / 0.01, rtol=1e-15
    )
    header = read_psins_header(tmp_path / "x.imu")
    assert_allclose(np.degrees(header.rpy), [2.0, 1.0, 90.6], rtol=1e-14)
    assert header.velocity_ned == (0.2, 0.1, -0.3)
    assert_allclose(np.degrees([header.lat, header.lon]), [34.246048, 108.909664], rtol=1e-15)
    assert (header.height, header.t0, header.interval_s, header.axes) == (
        380.0,
        5.0,
        0.01,
        "right forward up",
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("34.246048", "134.246048"), "x.imu:4: this line must hold latitude, longitude, height"),
        (
            ("0.1 0.2 0.3 100.0", "0.1 0.0 0.3 100.0"),
            "x.imu:5: this line must hold the values of one count",
        ),
        (("1 2 3 4 5 6", "1 2 3 4 5"), "x.imu:6: 5 fields, expected 6"),
        (("-5 -6\n", "-5 -6"), "x.imu:7: truncated"),
        (("1 2 3 4 5 6\n-1 -2 -3 -4 -5 -6\n", ""), "ends behind its header"),
        (
            ("0.1 0.2 0.3 100.0 110.0 120.0\n1 2 3 4 5 6\n-1 -2 -3 -4 -5 -6\n", ""),
            "ends within its header, 2 of 3 lines",
        ),
    ],
)
def test_psins_refusals(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    """Oracle: data_specs/psins.md."""
    (tmp_path / "x.imu").write_text(PSINS.replace(*change))
    with pytest.raises(InputError, match=message):
        read_imu(tmp_path / "x.imu", quantity="increments")


def test_recorded_laser_gyros() -> None:
    """Oracle: the recording's description: 184718 rows of 10 ms, mean rate -12.27 0.44 8.36 deg/h,
    specific force 1.00155 of its g.
    """
    path = DATA / "psins_lasergyro/lasergyro.imu"
    if not path.exists():
        pytest.skip("the recording psins_lasergyro is not at hand; it is not shipped")
    imu, header = read_imu(path, quantity="increments"), read_psins_header(path)
    assert imu.time.size == 184718
    assert_allclose(
        np.degrees(imu.gyro.mean(axis=0)) * 3600 / header.interval_s,
        [-12.27, 0.44, 8.36],
        atol=0.006,
    )
    assert np.linalg.norm(
        imu.accel.mean(axis=0)
    ) / header.interval_s / header.gravity == pytest.approx(1.00155, abs=1e-4)


def test_odyn_directory(tmp_path: Path) -> None:
    """Oracle: the numbers as a person reads them; a level body that looks north is the identity in
    north, east, down.
    """
    (tmp_path / "IMU.txt").write_text("10.0,0.1,0.2,0.3,1,2,-9.8\n10.002,0.1,0.2,0.3,1,2,-9.8\n")
    (tmp_path / "GPS.txt").write_text("10.0,46.57,6.54,630.0\n10.1,46.57,6.54,630.0\n")
    (tmp_path / "image_timestamps.txt").write_text("8001,10.05\n8002,10.08\n")
    imu, events = read_imu(tmp_path / "IMU.txt"), read_events(tmp_path / "image_timestamps.txt")
    gnss = read_gnss(tmp_path / "GPS.txt", sigma_m=[0.025, 0.025, 0.05])
    assert imu.accel[0].tolist() == [1.0, 2.0, -9.8]
    assert gnss.height.tolist() == [630.0, 630.0]
    assert events.images == ("8001", "8002")
    s = np.sqrt(0.5)
    (tmp_path / "reference.txt").write_text(
        f"10.0,46.57,6.54,630.0,0,{s:.12f},{s:.12f},0\n"
        f"11.0,46.57,6.54,630.0,{s:.12f},{s:.12f},0,0\n"
    )
    poses = read_odyn_poses(tmp_path / "reference.txt")
    assert_allclose(poses.C_nb[0], np.eye(3), rtol=0, atol=1e-12)
    # half a turn of 90 deg about x takes y to z: body y is up, body x stays east
    assert_allclose(
        poses.C_nb[1], np.column_stack([[0, 1, 0], [0, 0, -1], [-1, 0, 0]]), rtol=0, atol=1e-12
    )
    (tmp_path / "reference.txt").write_text("10.0,1250.0,6.54,630.0,1,0,0,0\n")
    with pytest.raises(InputError, match="are the positions in a local frame"):
        read_odyn_poses(tmp_path / "reference.txt")


def nmea(body: str) -> str:
    check = 0
    for c in body.encode():
        check ^= c
    return f"${body}*{check:02X}\r\n"


def gga(clock: str, talker: str = "GP", separation: str = "49.5") -> str:
    return nmea(
        f"{talker}GGA,{clock},4634.2,N,00632.4,E,4,20,0.6,580.5,M,{separation},M,1.4,74"
    ) + nmea(f"{talker}GST,{clock},2,,,,0.01,0.02,0.03")


def rmc(clock: str, speed: str = "10.0", course: str = "120.0", status: str = "A") -> str:
    return nmea(f"GLRMC,{clock},{status},,,,,{speed},{course},030718,,,A")


def test_nmea_velocity(tmp_path: Path) -> None:
    """Oracle: knots, sine and cosine by hand; an epoch without course and the vertical weigh
    nothing; VTG stands in for RMC.
    """
    text = (
        gga("100000.0")
        + rmc("100000.0")
        + gga("100001.0")
        + rmc("100001.0", course="")
        + gga("100002.0")
    )
    text += nmea("GNVTG,30.0,T,,M,20.0,N,37.04,K,A")
    (tmp_path / "x.nmea").write_text(text)
    assert read_gnss(tmp_path / "x.nmea").velocity_ned is None
    got = read_gnss(tmp_path / "x.nmea", sigma_velocity=[0.1, 0.2, 0.3])
    knot = 1852 / 3600
    assert got.velocity_ned is not None
    assert got.velocity_cov_ned is not None
    assert_allclose(got.velocity_ned[0], [-5.0 * knot, 5.0 * np.sqrt(3) * knot, 0.0], rtol=1e-12)
    assert_allclose(got.velocity_ned[2], [10.0 * np.sqrt(3) * knot, 10.0 * knot, 0.0], rtol=1e-12)
    sigma = np.sqrt(np.diagonal(got.velocity_cov_ned, axis1=1, axis2=2))
    assert_allclose(sigma, [[0.1, 0.2, 1000.0], [1000.0] * 3, [0.1, 0.2, 1000.0]])
    assert any("1 of 3 epochs without a course" in note.found for note in got.notes)


@pytest.mark.parametrize(
    ("before", "behind", "places"),
    [("2018-07-03 07:31:13.41 [INFO] gps: ", "", 6), ('73.4,"', '"', 6), ("", "", 0)],
)
def test_nmea_within_the_lines_of_a_logger(
    tmp_path: Path, before: str, behind: str, places: int
) -> None:
    """Oracle: the same log alone; text that is none of its sentences is counted in a note, and a
    sentence that lost its beginning still counts as damaged."""
    rows = gga("073113.40") + rmc("073113.40") + gga("073114.40") + rmc("073114.40")
    (tmp_path / "x.nmea").write_text(rows)
    within = [f"{before}{row}{behind}\n" for row in rows.split()]
    (tmp_path / "log.txt").write_text("".join(["u-blox, monitor\n"] * bool(before) + within))
    alone, got = read_gnss(tmp_path / "x.nmea"), read_gnss(tmp_path / "log.txt")
    np.testing.assert_array_equal(got.time, alone.time)
    np.testing.assert_array_equal(got.height, alone.height)
    counts = [note.found for note in got.notes]
    assert counts == [f"text other than sentences in {places + 1} places left out"] * bool(places)
    (tmp_path / "x.nmea").write_text(rows + "PGGA,073115.40,4634.2,N*33\n")
    with pytest.raises(InputError, match=r"x\.nmea:7: no right checksum in 'PGGA"):
        read_gnss(tmp_path / "x.nmea")


def test_nmea_recorded_velocity() -> None:
    """Oracle: central differences of the recorded RTK positions of a walk, one second apart; 0.15
    m/s of a swinging pole.
    """
    path = DATA / "tilt_rtk_walk/gnss.nmea"
    if not path.exists():
        pytest.skip("the recording tilt_rtk_walk is not at hand; it is not shipped")
    got = read_gnss(path, sigma_velocity=[0.1, 0.1, 0.1])
    assert got.velocity_ned is not None
    assert got.quality is not None
    north, east = 6371e3 * got.lat, 6371e3 * np.cos(got.lat[0]) * got.lon
    fixed = np.flatnonzero((got.quality[10:] == 1) & (got.quality[:-10] == 1))
    mean = np.array([got.velocity_ned[k : k + 11, :2].mean(axis=0) for k in fixed])
    moved = np.column_stack([north[fixed + 10] - north[fixed], east[fixed + 10] - east[fixed]])
    assert np.sqrt(np.mean((mean - moved) ** 2)) < 0.15


def test_nmea_date_of_zda_and_undulation_of_the_caller(tmp_path: Path) -> None:
    """Oracle: datetime arithmetic, 18 leap seconds; h = H + N. A void RMC's date is not used."""
    void = rmc("100000.0", status="V").replace("030718", "060180")
    (tmp_path / "x.nmea").write_text(
        nmea("GPZDA,100000.0,03,07,2018,00,00") + gga("100000.0", separation="")
    )
    got = read_gnss(tmp_path / "x.nmea", undulation_m=49.5)
    elapsed = (datetime(2018, 7, 3, 10) - datetime(1980, 1, 6)).total_seconds() + 18
    assert (got.gps_week, got.time[0], got.height[0]) == (
        elapsed // 604800,
        elapsed % 604800,
        630.0,
    )
    (tmp_path / "x.nmea").write_text(gga("100000.0") + void)
    with pytest.raises(InputError, match=r"no right checksum|no RMC or ZDA sentence"):
        read_gnss(tmp_path / "x.nmea")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (gga("256000.0") + rmc("100000.0"), "x.nmea:1: time '256000.0' is not hhmmss"),
        (gga("100000.0").replace("4634.2", "4674.2"), "x.nmea:1: no right checksum"),
        (
            nmea("GPGGA,100000.0,4674.2,N,00632.4,E,4,20,0.6,580.5,M,1,M,1,7") + rmc("100000.0"),
            "x.nmea:1: angle '4674.2' is not dddmm",
        ),
        (
            nmea("GPGGA,100000.0,4634.2,X,00632.4,E,4,20,0.6,580.5,M,1,M,1,7") + rmc("100000.0"),
            "x.nmea:1: hemisphere 'X'",
        ),
        (
            nmea("GPZDA,100000.0,03,07,99999999999999999999,00,00"),
            "x.nmea:1: date '030799999999999999999999' is not ddmmyy",
        ),
        (
            gga("100000.0", separation="") + rmc("100000.0"),
            "without geoid separation; .*set undulation_m",
        ),
    ],
)
def test_nmea_refusals(tmp_path: Path, text: str, message: str) -> None:
    """Oracle: data_specs/nmea.md."""
    (tmp_path / "x.nmea").write_text(text)
    with pytest.raises(InputError, match=message):
        read_gnss(tmp_path / "x.nmea")


def test_receivers_with_two_talkers_and_a_cut_log(tmp_path: Path) -> None:
    """Oracle: each epoch once; the cut sentence is counted."""
    text = "".join(
        gga(f"1000{k:02d}.0") + gga(f"1000{k:02d}.0", "GN") + rmc(f"1000{k:02d}.0")
        for k in range(60)
    )
    (tmp_path / "x.nmea").write_text(text[:-9])
    got = read_gnss(tmp_path / "x.nmea")
    assert got.time.size == 60
    assert [note.found.split(";")[0] for note in got.notes] == [
        "left out 1 lines without a right checksum, 0 epochs without fix, 0 of 120 fixes without"
        " GST",
        "60 double rows left out, of 120",
    ]


def test_a_kind_of_sentence_whose_checksums_are_all_wrong_is_taken(tmp_path: Path) -> None:
    """Oracle: the log with right ones: a program that changed every RMC and left the checksum, or
    cut it off; a single right one, GGA without, or no other kind make it damage.
    """
    path = tmp_path / "x.nmea"
    times = [f"1000{k:02d}.0" for k in range(30)]

    def wrong(sentence: str) -> str:
        return sentence.replace("*", "*F" if sentence[-4:-2] != "FF" else "*0")

    def read(dates: list[str], fixes: list[str]) -> GnssFixes:
        path.write_text("".join(a + b for a, b in zip(fixes, dates, strict=True)))
        return read_gnss(path)

    right, fixes = [rmc(time) for time in times], [gga(time) for time in times]
    good = read(right, fixes)
    for bad in ([wrong(s) for s in right], [s.partition("*")[0] + "\r\n" for s in right]):
        got = read(bad, fixes)
        np.testing.assert_array_equal(got.time, good.time)
        assert got.gps_week == good.gps_week
        assert [note.found for note in got.notes if note not in good.notes] == [
            "all checksums of 30 RMC are wrong, of other kinds right; these were used"
        ]
        for dates, others in (
            ([right[0], *bad[1:]], fixes),
            (right, [wrong(s) for s in fixes]),
            (bad[:15], fixes[:15]),
            (bad, bad),
        ):
            with pytest.raises(InputError, match=r"x.nmea:\d+: no right checksum"):
                read(dates, others)


@pytest.mark.parametrize(
    ("name", "rows", "velocity"),
    [
        ("kfginsmatlab_dataset2_GNSS-POSVEL.txt", 203, True),
        ("kfginsmatlab_dataset2_truth.nav", 3553, True),
    ],
)
def test_reference_files_without_header(name: str, rows: int, velocity: bool) -> None:
    """Oracle: numpy.loadtxt by the column numbers of the recordings' description."""
    path = DATA / "whu_gnss_only" / name
    if not path.exists():
        pytest.skip("the recording whu_gnss_only is not at hand; it is not shipped")
    raw = np.loadtxt(path)
    got = read_gnss(path, sigma_m=[0.1, 0.1, 0.1], sigma_velocity=[0.1, 0.1, 0.1])
    first = 1 if name.endswith(".nav") else 0
    at = 5 if name.endswith(".nav") else 7
    assert got.velocity_ned is not None
    assert (got.time.size, got.gps_week) == (len(raw), None)
    assert_allclose(got.time, raw[:, first], rtol=1e-15)
    assert_allclose(got.velocity_ned, raw[:, at : at + 3], rtol=1e-15)
    if first == 0:
        assert_allclose(
            np.sqrt(np.diagonal(got.cov_ned, axis1=1, axis2=2)), raw[:, 4:7], rtol=1e-14
        )
