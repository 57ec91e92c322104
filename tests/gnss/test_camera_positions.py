"""The camera at the exposures by PPK alone: places, standard deviations, offsets of the drone."""

from dataclasses import replace

import numpy as np
import pytest

from insgnss.base.errors import DataError
from insgnss.geodesy.frames import LocalFrame
from insgnss.gnss.exposures.camera_positions import camera_positions
from insgnss.io.exposures.match import name_events
from insgnss.io.formats import read_events
from insgnss.io.formats.positions.camera_positions import (
    read_camera_positions,
    write_camera_positions,
)
from insgnss.records import CameraEvents, GnssFixes

FRAME = LocalFrame(0.82, 0.11, 450.0)
SIGMA = np.array([0.012, 0.01, 0.02])


def fixes_of(time, ned, quality=None):
    lat, lon, height = FRAME.geodetic_from_position(ned)
    cov = np.broadcast_to(np.diag(SIGMA**2), (time.size, 3, 3))
    quality = np.ones(time.size) if quality is None else quality
    return GnssFixes(time, lat, lon, height, cov, quality=quality, gps_week=2024)


def events_of(time, **more):
    return CameraEvents(tuple(f"i{k}" for k in range(len(time))), time, 2024, "events", **more)


def ned_of(positions):
    return FRAME.position_from_geodetic(positions.lat, positions.lon, positions.height)


@pytest.mark.parametrize("interval", [0.2, 1.0])
def test_interpolation_errs_by_its_standard_deviation(interval):
    """Oracle: a path of white accelerations of 0.1 s that is known between its fixes, which have no
    noise: the errors' mean normalised square, 600 of them, is near 1.
    """
    rng = np.random.default_rng(4)
    fine = np.arange(0.0, 400.0, 0.02)
    drive = np.repeat(rng.standard_normal((fine.size // 5, 3)), 5, axis=0)
    ned = np.cumsum(np.cumsum(drive, axis=0) * 0.02, axis=0) * 0.02
    step = round(interval / 0.02)
    fixes = fixes_of(fine[::step], ned[::step])
    rows = np.sort(rng.choice(np.arange(4 * step, fine.size - 4 * step), 600, replace=False))
    rows = rows[rows % step > 0]
    positions, (_, check) = camera_positions(fixes, events_of(fine[rows]))
    extra = positions.cov_ned[:, 0, 0] - SIGMA[0] ** 2
    error = ned_of(positions) - ned[rows]
    assert 0.4 < np.mean(error**2 / extra[:, None]) < 1.6
    assert check.found.startswith("standard deviation")


def test_a_drone_moves_its_camera_by_its_offset(tmp_path):
    """Oracle: N, E, V of the lines by hand, mm, down positive; the antenna is at 1, 2, -30 m."""
    line = "{}\t{}\t[2024]\t{},N\t{},E\t{},V\t46.98,Lat\t6.3,Lon\t480.0,Ellh\t1, 1, 1\t50,Q\n"
    path = tmp_path / "x_Timestamp.MRK"
    path.write_text(line.format(1, 10.5, -26, 19, 191) + line.format(2, 12.5, 160, 18, 100))
    events = name_events(read_events(path), ["a.jpg", "b.jpg"])
    time = np.arange(9.0, 15.0)
    fixes = fixes_of(time, np.tile([1.0, 2.0, -30.0], (6, 1)))
    positions, (what, _) = camera_positions(fixes, events)
    expected = [[0.974, 2.019, -29.809], [1.16, 2.018, -29.9]]
    np.testing.assert_allclose(ned_of(positions), expected, atol=1e-5)
    assert positions.images == ("a.jpg", "b.jpg")
    assert (positions.of_camera == 1.0).all()
    assert what.found == "2 of the camera, 190 to 194 mm from the antenna"
    np.testing.assert_allclose(np.sqrt(np.diagonal(positions.cov_ned[0])), SIGMA, rtol=1e-6)


def test_an_uncertain_time_is_an_uncertain_place_along_the_path():
    """Oracle: 10 m/s times 0.29 s, by hand, north alone."""
    time = np.arange(0.0, 20.0)
    fixes = fixes_of(time, np.column_stack([10.0 * time, 0.0 * time, 0.0 * time]))
    positions, _ = camera_positions(
        fixes, events_of(np.array([8.4, 9.4]), sigma_s=np.array([0.0, 0.29]))
    )
    sigma = np.sqrt(np.diagonal(positions.cov_ned, axis1=1, axis2=2))
    np.testing.assert_allclose(sigma[0], SIGMA, rtol=1e-3)
    np.testing.assert_allclose(sigma[1], [2.9, *SIGMA[1:]], rtol=2e-3)


def test_the_worse_fix_counts_and_gaps_have_no_position(tmp_path):
    """Oracle: by hand. Exposures in a gap and outside are left out, one in the next week is not."""
    time = np.array([0.0, 1.0, 2.0, 3.0, 9.0, 10.0, 11.0, 12.0])
    fixes = fixes_of(time, np.zeros((8, 3)), np.array([1, 1, 2, 1, 1, 1, 1, 1]))
    events = events_of(np.array([-4.0, 0.5, 1.5, 6.0, 10.5]))
    positions, (what, _) = camera_positions(fixes, events)
    assert positions.images == ("i1", "i2", "i4")
    assert positions.quality.tolist() == [1.0, 2.0, 1.0]
    assert (what.verdict, positions.of_camera.max()) == ("note", 0.0)
    write_camera_positions(positions, tmp_path / "camera_positions.csv")
    read = read_camera_positions(tmp_path / "camera_positions.csv")
    np.testing.assert_allclose(ned_of(read), ned_of(positions), atol=1e-4)
    np.testing.assert_allclose(read.time, positions.time)
    assert read.quality.tolist() == [1.0, 2.0, 1.0]
    with pytest.raises(DataError, match="none of the 5 exposures lies between fixes"):
        camera_positions(fixes, replace(events, time=events.time + 100.0))
