"""From the trajectory at the exposures to the exterior orientation of the images in the tangent
plane.

With m the tangent plane (axes east-north-up at its origin, Earth-fixed), n north-east-down at the
navigation centre, T and B of the mounting and c^b the vector from the IMU to the projection centre
in body axes:

    X_m = x_m(lat, lon, h) + C_mn C_nb c^b,        C_mc = C_mn C_nb (T B)'                     (O.1)

which is equation (1) of paper 000, R_enu^c = T B R_ned^b T_enu^ned, with the attitude moved to the
axes of the origin: C_mn is the exact rotation between the local verticals and meridians of the two
points (34 arcsec a kilometre at mid latitudes). The error of the centre is that of the navigation
point and what psi makes of the lever arm; the camera's psi is the body's, in m:

    J = [ C_mn   -[C_mn C_nb c^b x] C_mn ;  0   C_mn ]
    cov = J P J',   cross_k,k+1 = J_k P_k,k+1 J_k+1'                                           (O.2)

The projection centre moves with the navigation point and around it, the camera turns as the body,
omega^b with respect to the Earth:

    omega_m = C_mn C_nb omega^b,    dX_m/dt = C_mn v_n + omega_m x C_mn C_nb c^b              (O.3)
"""

import numpy as np

from ...base.errors import InputError
from ...geodesy.frames import TangentPlane
from ...geodesy.rotation import skew
from ...records import Array, CameraEvents, ExteriorOrientation, Trajectory
from ...records.cameras.mounting import Mounting


def exterior_orientation(
    at_exposure: Trajectory,
    events: CameraEvents,
    mounting: Mounting,
    plane: TangentPlane,
    history: tuple[str, ...] = (),
) -> ExteriorOrientation:
    """Compute the exterior orientation of every event with its covariances (O.1 to O.3).

    Parameters
    ----------
    at_exposure : Trajectory
        The trajectory at exactly the times of the n events, with `cross`.
    events : CameraEvents
        The n exposures.
    mounting : Mounting
        Lever arms and bore-sight.
    plane : TangentPlane
        The tangent plane in which the orientation is wanted.
    history : tuple of str
        What was done before, sentence by sentence; the result carries it.

    Returns
    -------
    ExteriorOrientation
        Position (m) and attitude of each image in the axes of the tangent plane, with (n, 6, 6)
        covariances and (n - 1, 6, 6) cross-covariances of neighbours; velocity and angular rate
        where the trajectory has rates.

    Raises
    ------
    InputError
        Where the times of the trajectory are not those of the events.
    """
    if (
        at_exposure.time.shape != events.time.shape
        or (np.abs(at_exposure.time - events.time) > 1e-6).any()
    ):
        raise InputError(
            "exterior_orientation: the trajectory must be given at the times of the exposures"
        )
    C_mn, C_mb = _axes(at_exposure, plane)
    lever_m = C_mb @ mounting.camera_lever_b
    J = pose_derivatives(at_exposure, mounting, plane)
    J_t = np.swapaxes(J, -1, -2)
    cov = J @ at_exposure.cov @ J_t
    n = len(events.images)
    cross = np.zeros((max(n - 1, 0), 6, 6))
    if at_exposure.cross is not None:
        cross = J[:-1] @ at_exposure.cross @ J_t[1:]
    velocity = rate = None
    if at_exposure.rate_b is not None:
        rate = np.einsum("nij,nj->ni", C_mb, at_exposure.rate_b)
        velocity = np.einsum("nij,nj->ni", C_mn, at_exposure.velocity_ned)
        velocity = velocity + np.cross(rate, lever_m)
    return ExteriorOrientation(
        events.images,
        events.time,
        at_exposure.gps_week,
        np.array([plane.lat, plane.lon, plane.height]),
        plane.position_from_geodetic(at_exposure.lat, at_exposure.lon, at_exposure.height)
        + lever_m,
        C_mb @ mounting.C_cb.T,
        0.5 * (cov + np.swapaxes(cov, -1, -2)),
        cross,
        mounting.boresight,
        mounting.camera_from_body,
        history,
        velocity_mps=velocity,
        rate_radps=rate,
    )


def pose_derivatives(at_exposure: Trajectory, mounting: Mounting, plane: TangentPlane) -> Array:
    """Return J of (O.2) of every exposure, by which errors of several of them are turned together.

    Parameters
    ----------
    at_exposure : Trajectory
        The trajectory at the times of the n exposures.
    mounting : Mounting
        Lever arms and bore-sight.
    plane : TangentPlane
        The tangent plane.

    Returns
    -------
    Array
        (n, 6, 9): errors of projection centre and camera in tangent-plane axes by those of
        position, velocity (which make none) and psi of the navigation centre, in axes north, east,
        down at the point.
    """
    C_mn, C_mb = _axes(at_exposure, plane)
    lever_m, J = C_mb @ mounting.camera_lever_b, np.zeros((len(at_exposure), 6, 9))
    J[:, :3, :3] = C_mn
    J[:, 3:, 6:] = C_mn
    J[:, :3, 6:] = -skew(lever_m) @ C_mn
    return J


def _axes(at_exposure: Trajectory, plane: TangentPlane) -> tuple[Array, Array]:
    """C_mn and C_mb, (n, 3, 3)."""
    C_mn = plane.C_mn(at_exposure.lat, at_exposure.lon)
    return C_mn, C_mn @ at_exposure.C_nb
