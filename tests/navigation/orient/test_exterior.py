"""The exterior orientation: position, attitude and covariances of each image, by other ways.

Oracles: pyproj for where points and verticals are, scipy for rotations, the central differences of
the public function for its covariance, and draws of the navigation errors for what neighbours
share. The lever arm has metres and the bore-sight degrees, so that none of their terms can hide in
a tolerance; the images lie up to 10 km from the origin and up to 18 km from each other.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from pyproj import Transformer
from scipy.spatial.transform import Rotation

from insgnss.base.errors import InputError
from insgnss.geodesy.frames import TangentPlane
from insgnss.navigation.orient.exterior import exterior_orientation
from insgnss.records import CameraEvents, ExteriorOrientation, Trajectory
from insgnss.records.cameras.mounting import Mounting

Array = NDArray[np.float64]

LAT_DEG, LON_DEG, HEIGHT = 46.57, 6.54, 400.0
PLANE = TangentPlane(np.radians(LAT_DEG), np.radians(LON_DEG), HEIGHT)
ENU = np.array(
    [[0.0, 0.0, 300.0], [10000.0, 0.0, 350.0], [-6000.0, 8000.0, 310.0], [500.0, -9990.0, 305.0]]
)
RPY_DEG = np.array(
    [[3.0, -2.0, 47.0], [-8.0, 5.0, 200.0], [12.0, 9.0, -75.0], [-4.0, -11.0, 130.0]]
)
T = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
B = Rotation.from_euler("XYZ", [4.0, -3.0, 6.0], degrees=True).as_matrix()
IMU_M = np.array([2.1, -1.3, 0.8])
MOUNTING = Mounting(antenna_m=[0.5, 0.1, -1.0], imu_m=IMU_M, camera_from_body=T, boresight=B)
SIGMA = np.array([0.02, 0.03, 0.05, 0.01, 0.01, 0.02, 1e-3, 2e-3, 4e-3])
POSE_SIGMA = np.array([0.02, 0.02, 0.03, 1e-3, 1e-3, 2e-3])
"""Scale, m and rad, in which covariances are compared."""

_ECEF = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
_TOPOCENTRIC = Transformer.from_pipeline(
    "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84"
    f" +lon_0={LON_DEG} +lat_0={LAT_DEG} +h_0={HEIGHT}"
)


def enu_of(lat: Array, lon: Array, h: Array) -> Array:
    """East, north, up (n, 3), m, of latitude and longitude, rad, and height, m, by pyproj."""
    return np.column_stack(_TOPOCENTRIC.transform(np.degrees(lon), np.degrees(lat), h))


def geodetic_of(enu: Array) -> tuple[Array, Array, Array]:
    """Latitude, longitude, rad, and height, m, of east, north, up (n, 3), m, by pyproj."""
    lon, lat, h = _TOPOCENTRIC.transform(*enu.T, direction="INVERSE")
    return np.radians(lat), np.radians(lon), np.asarray(h)


def ned_to_enu(lat: Array, lon: Array) -> Array:
    """C_mn (n, 3, 3) from positions alone: pyproj's point moved up and, symmetrically, east."""
    up = enu_of(lat, lon, np.full(lat.shape, 1e3)) - enu_of(lat, lon, np.full(lat.shape, -1e3))
    zero = np.zeros(lat.shape)
    east = enu_of(lat, lon + 1e-4, zero) - enu_of(lat, lon - 1e-4, zero)
    up, east = (v / np.linalg.norm(v, axis=1)[:, None] for v in (up, east))
    return np.stack([np.cross(up, east), east, -up], axis=2)


def joint_factor(n: int, seed: int = 3) -> Array:
    """L (9 n, 9 n + 9): the joint covariance of all images' navigation errors is L L'.

    Neighbours share much, each pair something else, and no block is symmetric.
    """
    rng = np.random.default_rng(seed)
    own = rng.standard_normal((9 * n, 9 * n)) / np.sqrt(9 * n)
    shared = rng.standard_normal((9 * n, 9)) * 0.6
    return np.hstack([own, shared]) * np.tile(SIGMA, n)[:, None]


def flight(seed: int = 3) -> tuple[Trajectory, CameraEvents, Array]:
    """The trajectory at the exposures, its events, and the factor of the joint covariance."""
    n = len(ENU)
    L = joint_factor(n, seed)
    P = (L @ L.T).reshape(n, 9, n, 9).swapaxes(1, 2)
    lat, lon, h = geodetic_of(ENU)
    time = 1000.0 + 2.0 * np.arange(n)
    trajectory = Trajectory(
        time=time,
        lat=lat,
        lon=lon,
        height=h,
        velocity_ned=np.tile([10.0, 5.0, 0.0], (n, 1)),
        C_nb=Rotation.from_euler("ZYX", RPY_DEG[:, ::-1], degrees=True).as_matrix(),
        cov=P[np.arange(n), np.arange(n)],
        gps_week=2008,
        cross=P[np.arange(n - 1), np.arange(1, n)],
    )
    return trajectory, CameraEvents(tuple(f"{k}.tif" for k in range(n)), time, 2008), L


def moved(trajectory: Trajectory, k: int, error: Array) -> Trajectory:
    """Image `k` of the trajectory at each error (d, 9): position and psi, in NED axes at the point.

    A displacement leaves the attitude towards the Earth as it is: it is the error of the position.
    """
    d = len(error)
    here = np.full(d, k)
    C_mn = ned_to_enu(trajectory.lat[here[:1]], trajectory.lon[here[:1]])[0]
    lat, lon, h = geodetic_of(ENU[k] + error[:, :3] @ C_mn.T)
    turn = Rotation.from_rotvec(error[:, 6:]).as_matrix() @ trajectory.C_nb[k]
    C_nb = ned_to_enu(lat, lon).swapaxes(1, 2) @ C_mn @ turn
    velocity = trajectory.velocity_ned[here] + error[:, 3:6]
    return Trajectory(np.arange(d) + 1.0, lat, lon, h, velocity, C_nb, np.zeros((d, 9, 9)), 2008)


def of(trajectory: Trajectory) -> ExteriorOrientation:
    """The exterior orientation of a trajectory whose rows are exposures."""
    names = tuple(str(k) for k in range(trajectory.time.size))
    events = CameraEvents(names, trajectory.time, 2008)
    return exterior_orientation(trajectory, events, MOUNTING, PLANE)


def errors_of(eo: ExteriorOrientation, truth: ExteriorOrientation) -> Array:
    """(d, 6) of d true orientations: position minus that of the estimate `eo` (one image), psi."""
    turn = truth.C_mc @ eo.C_mc.swapaxes(1, 2)
    return np.hstack([truth.position_m - eo.position_m, Rotation.from_matrix(turn).as_rotvec()])


def numeric_jacobians(trajectory: Trajectory) -> Array:
    """(n, 6, 9) by central differences of `exterior_orientation`: 1 m, 1 m/s, 1e-4 rad.

    The map is linear in the position, and the third order of a turn is 2e-9 of it.
    """
    step = np.repeat([1.0, 1.0, 1e-4], 3)
    out = []
    for k in range(trajectory.time.size):
        at = of(moved(trajectory, k, np.zeros((1, 9))))
        ahead, behind = (
            errors_of(at, of(moved(trajectory, k, sign * np.diag(step)))) for sign in (1.0, -1.0)
        )
        out.append(((ahead - behind) / (2.0 * step[:, None])).T)
    return np.array(out)


def test_position_is_that_of_the_camera_behind_its_lever_arm() -> None:
    """Oracle: pyproj's tangent plane and verticals, scipy's attitude, the vector IMU to camera.

    The camera is at minus `imu_m` in camera axes. 1e-6 m; the lever arm has 2.6 m, and the axes of
    the origin in place of those 10 km away would move it by 4 mm.
    """
    trajectory, events, _ = flight()
    eo = exterior_orientation(trajectory, events, MOUNTING, PLANE)
    C_bc = (T @ B).T
    C_mn = ned_to_enu(trajectory.lat, trajectory.lon)
    expected = ENU + (C_mn @ trajectory.C_nb @ C_bc) @ -IMU_M
    assert np.abs(eo.position_m - expected).max() < 1e-6


def test_attitude_is_that_of_the_camera_in_the_axes_of_the_origin() -> None:
    """Oracle: equation (1) of paper 000 with scipy's attitude and pyproj's verticals; 1e-9 rad."""
    trajectory, events, _ = flight()
    eo = exterior_orientation(trajectory, events, MOUNTING, PLANE)
    C_cm = T @ B @ trajectory.C_nb.swapaxes(1, 2)
    C_cm = C_cm @ ned_to_enu(trajectory.lat, trajectory.lon).swapaxes(1, 2)
    assert np.abs(eo.C_mc - C_cm.swapaxes(1, 2)).max() < 1e-9
    assert (eo.boresight == MOUNTING.boresight).all()
    assert (eo.camera_from_body == MOUNTING.camera_from_body).all()


def test_meridians_converge_by_34_seconds_of_arc_a_kilometre() -> None:
    """Oracle: closed form, 10 km to the east: convergence d lon sin(lat), inclination 10 km / N.

    341 and 323 seconds of arc; half a second of arc for the higher orders.
    """
    trajectory, events, _ = flight()
    level = replace(trajectory, C_nb=np.tile(np.eye(3), (len(ENU), 1, 1)))
    plain = Mounting(camera_from_body=np.eye(3))
    eo = exterior_orientation(level, events, plain, PLANE)
    north, down = eo.C_mc[1, :, 0], eo.C_mc[1, :, 2]
    second = np.radians(1.0 / 3600.0)
    convergence = (trajectory.lon[1] - np.radians(LON_DEG)) * np.sin(np.radians(LAT_DEG))
    assert convergence == pytest.approx(341.0 * second, abs=2.0 * second)
    assert -np.arctan2(north[0], north[1]) == pytest.approx(convergence, abs=0.5 * second)
    normal_m = 6378137.0 / np.sqrt(1.0 - 0.00669438 * np.sin(np.radians(LAT_DEG)) ** 2)
    assert -down[0] == pytest.approx(10000.0 / (normal_m + 750.0), abs=0.5 * second)


def test_covariance_is_that_of_a_numeric_jacobian() -> None:
    """Oracle: central differences of the public function; all 36 entries, in units of sigma.

    1e-6; the lever arm of 2.6 m makes some 15 mm of position error out of attitude errors.
    """
    trajectory, events, _ = flight()
    eo = exterior_orientation(trajectory, events, MOUNTING, PLANE)
    J = numeric_jacobians(trajectory)
    expected = J @ trajectory.cov @ J.swapaxes(1, 2)
    assert np.abs((eo.cov - expected) / np.outer(POSE_SIGMA, POSE_SIGMA)).max() < 1e-6
    assert (eo.cov == eo.cov.swapaxes(1, 2)).all()


def test_cross_covariance_is_that_of_a_numeric_jacobian_with_the_next_image() -> None:
    """Oracle: central differences of the public function, J_k P_k,k+1 J_k+1'; in units of sigma."""
    trajectory, events, _ = flight()
    eo = exterior_orientation(trajectory, events, MOUNTING, PLANE)
    J = numeric_jacobians(trajectory)
    assert trajectory.cross is not None
    expected = J[:-1] @ trajectory.cross @ J[1:].swapaxes(1, 2)
    scale = np.outer(POSE_SIGMA, POSE_SIGMA)
    assert np.abs((eo.cross - expected) / scale).max() < 1e-6
    assert np.abs((expected - expected.swapaxes(1, 2)) / scale).max() > 0.1  # no block is symmetric


def test_covariances_are_those_of_drawn_navigation_errors() -> None:
    """Oracle: 10000 draws of all images' navigation errors together, each image oriented anew.

    An entry of a sample's correlation has a standard deviation of 0.01; 5 of them.
    """
    trajectory, events, L = flight()
    eo = exterior_orientation(trajectory, events, MOUNTING, PLANE)
    n, draws = len(ENU), 10000
    x = (np.random.default_rng(8).standard_normal((draws, L.shape[1])) @ L.T).reshape(draws, n, 9)
    e = [
        errors_of(of(moved(trajectory, k, np.zeros((1, 9)))), of(moved(trajectory, k, x[:, k])))
        for k in range(n)
    ]
    sigma = np.sqrt(np.diagonal(eo.cov, axis1=1, axis2=2))
    for k in range(n):
        off = e[k].T @ e[k] / draws - eo.cov[k]
        assert np.abs(off / np.outer(sigma[k], sigma[k])).max() < 0.08  # variances have 0.014
    for k in range(n - 1):
        off = e[k].T @ e[k + 1] / draws - eo.cross[k]
        scale = np.outer(sigma[k], sigma[k + 1])
        assert np.abs(off / scale).max() < 0.05
        assert np.abs(eo.cross[k] / scale).max() > 0.25  # neighbours do share their errors


def test_neighbours_of_which_nothing_is_known_share_nothing() -> None:
    """Oracle: a trajectory without cross-covariances, of no image and of one."""
    trajectory, events, _ = flight()
    eo = exterior_orientation(replace(trajectory, cross=None), events, MOUNTING, PLANE)
    assert (eo.cross == 0.0).all()
    for n in (0, 1):
        rows = {
            f: getattr(trajectory, f)[:n] for f in ("time", "lat", "lon", "height", "C_nb", "cov")
        }
        few = Trajectory(velocity_ned=trajectory.velocity_ned[:n], gps_week=2008, **rows)
        eo = of(few)
        assert eo.position_m.shape == (n, 3)
        assert eo.cross.shape == (0, 6, 6)


@pytest.mark.parametrize("late_s", [2e-6, 0.5])
def test_trajectory_at_other_times_is_refused(late_s: float) -> None:
    """Oracle: the promise of a microsecond, 15 um at 15 m/s."""
    trajectory, events, _ = flight()
    with pytest.raises(InputError, match="at the times of the exposures"):
        exterior_orientation(
            trajectory, replace(events, time=events.time + late_s), MOUNTING, PLANE
        )
    fewer = CameraEvents(events.images[:3], events.time[:3], 2008)
    with pytest.raises(InputError, match="at the times of the exposures"):
        exterior_orientation(trajectory, fewer, MOUNTING, PLANE)
    near = replace(events, time=events.time + 5e-7)
    assert exterior_orientation(trajectory, near, MOUNTING, PLANE).images == events.images
