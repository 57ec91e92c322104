"""Satellites from their broadcast messages: position, velocity, clock and clock drift in ECEF, and
where they stand in the sky.

Kepler elements (GPS, QZSS, Galileo, BeiDou), tk = t - toe, with a = sqrt(a)^2, A the mean and E the
eccentric anomaly:

    A = M0 + (sqrt(mu / a^3) + dn) tk = E - e sin E                                            (O.1)
    phi = atan2(sqrt(1 - e^2) sin E, cos E - e) + omega                                        (O.2)
    u = phi + Cus sin 2 phi + Cuc cos 2 phi,   r = a (1 - e cos E) + Crs sin 2 phi + Crc cos 2 phi,
    i = i0 + i' tk + Cis sin 2 phi + Cic cos 2 phi                                             (O.3)
    Omega = Omega0 + (Omega' - w) tk - w toe_sow                                               (O.4)
    r_e = Rz(Omega)^T Rx(i)^T (r cos u, r sin u, 0)                                            (O.5)
    dt = af0 + af1 tc + af2 tc^2 - 2 sqrt(mu a) e sin E / c^2,   tc = t - toc                  (O.6)

Velocities and drifts are the time derivatives of these. BeiDou GEO: Omega = Omega0 + Omega' tk - w
toe_sow in (O.5), and then

    r_e = Rz(w tk) Rx(-5 deg) r                                                                (O.7)

GLONASS: the state is integrated from toe (Runge-Kutta of fourth order, steps of 60 s), with R =
|r|, a_ls of Sun and Moon held:

    r'' = -mu r / R^3 - 3/2 J2 mu a_E^2 / R^5 (1 - 5 z^2 / R^2) (x, y, z) - 3 J2 mu a_E^2 / R^5 (0,
    0, z)
          + w^2 (x, y, 0) + 2 w (y', -x', 0) + a_ls,   dt = -tau + gamma tc                    (O.8)

A signal received at T of the receiver's clock with code range P was sent at T - P / c of the
satellite's, whatever the receiver's error: at t = T - P / c - dt of system time (O.9). PZ-90.11 and
CGCS2000 are taken for WGS84 (centimetres), and group delays are left out.

IS-GPS-200 20.3.3.4.3; Galileo OS SIS ICD 5.1.1; BeiDou ICD B1I 5.2.4.12; GLONASS ICD 5.1 A.3.1.2.
Accuracy is that of the messages, 1 to 2 m (GLONASS 3 to 5 m); the evaluation agrees with others to
below a millimetre (GLONASS: millimetres of the integration).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...geodesy.frames import ecef_to_geodetic, rotation_en
from ..rinex.navigation_message import TOE, Navigation
from ..rinex.systems import CONSTANTS
from .constants import LIGHT

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_, GPS_EARTH_RATE = CONSTANTS["G"]  # rad/s
# farthest time from the time of ephemeris
REACH_S = {"G": 7200.0, "J": 7200.0, "E": 14400.0, "C": 21600.0, "R": 1800.0}


@dataclass(frozen=True, eq=False)
class SatelliteStates:
    """Satellites in ECEF at given instants; not-a-number where no message reaches.

    Parameters
    ----------
    position : ndarray, shape (m, 3)
        m.
    velocity : ndarray, shape (m, 3)
        m/s, relative to the rotating Earth.
    clock_s : ndarray, shape (m,)
        Satellite's clock minus system time, s, with relativity, without group delay.
    drift : ndarray, shape (m,)
        Rate of the clock, s/s.
    message : ndarray of int, shape (m,)
        Row of the navigation table, or -1.
    """

    position: Array
    velocity: Array
    clock_s: Array
    drift: Array
    message: Index


LETTER_BITS = 21  # of a character: Unicode has no more


def select_messages(navigation: Navigation, satellite: ArrayLike, time: ArrayLike) -> Index:
    """Return the row (m,) of the message whose time of ephemeris is nearest.

    It is -1 where none is within `REACH_S` of its system.

    Parameters
    ----------
    navigation : Navigation
        Broadcast messages.
    satellite : array_like of str, shape (m,)
        Codes such as "G05".
    time : array_like, shape (m,)
        s, GPST of the navigation's week.
    """
    satellite, time = np.asarray(satellite, dtype="U3"), np.asarray(time, dtype=np.float64)
    chosen = np.full(time.shape, -1, dtype=np.int64)
    if satellite.size == 0:  # np.split would return one group
        return chosen
    codes, inverse = unique_satellites(satellite)
    order = np.argsort(inverse, kind="stable")
    ends = np.cumsum(np.bincount(inverse, minlength=len(codes)))
    for code, rows in zip(codes, np.split(order, ends[:-1]), strict=True):
        messages = np.flatnonzero(navigation.satellite == code)
        if messages.size == 0:
            continue
        toe, first_of_toe = np.unique(navigation.table[messages, TOE], return_index=True)
        nearest = np.searchsorted(0.5 * (toe[1:] + toe[:-1]), time[rows])
        within = np.abs(time[rows] - toe[nearest]) <= REACH_S[code[0]]
        chosen[rows] = np.where(within, messages[first_of_toe[nearest]], -1)
    return chosen


def unique_satellites(satellite: NDArray[np.str_]) -> tuple[list[str], Index]:
    """Return the codes that occur, sorted, and the index (m,) among them of each of `satellite`."""
    letters = (
        np.ascontiguousarray(satellite, dtype="U3").view(np.uint32).reshape(-1, 3).astype(np.int64)
    )
    shifts = (2 * LETTER_BITS, LETTER_BITS, 0)
    keys, inverse = np.unique((letters << np.array(shifts)).sum(axis=1), return_inverse=True)
    mask = (1 << LETTER_BITS) - 1
    codes = ["".join(chr(int(key >> shift) & mask) for shift in shifts) for key in keys]
    return codes, inverse.reshape(-1)


def satellite_states(
    navigation: Navigation, satellite: ArrayLike, time: ArrayLike, message: Index | None = None
) -> SatelliteStates:
    """Return the states of satellites (m,) at `time` (m,), s, GPST of the navigation's week.

    They are of given rows `message` where these are to be kept.
    """
    return _states(navigation, satellite, time, np.empty(0), message)


def emission_states(
    navigation: Navigation,
    satellite: ArrayLike,
    stamp: ArrayLike,
    pseudorange: ArrayLike,
    message: Index | None = None,
) -> SatelliteStates:
    """Return the states at the instant of emission (O.9), in the ECEF axes of that instant.

    Parameters
    ----------
    navigation : Navigation
        Broadcast messages.
    satellite : array_like of str, shape (m,)
        Codes such as "G05".
    stamp : array_like, shape (m,)
        s, GPST of the navigation's week by the receiver's clock.
    pseudorange : array_like, shape (m,)
        m, code.
    message : ndarray of int, shape (m,), optional
        Rows of messages to be kept.
    """
    return _states(navigation, satellite, stamp, pseudorange, message)


def _states(
    navigation: Navigation,
    satellite: ArrayLike,
    time: ArrayLike,
    pseudorange: ArrayLike,
    message: Index | None,
) -> SatelliteStates:
    """Return the states (m,) at emission; at `time` where there are no pseudoranges."""
    from . import _orbit_kernels

    time = np.ascontiguousarray(time, dtype=np.float64)
    pseudorange = np.ascontiguousarray(pseudorange, dtype=np.float64)
    message = select_messages(navigation, satellite, time) if message is None else message
    out = np.empty((time.size, 8))
    _orbit_kernels.states(navigation.table, message, time, pseudorange, out)
    return SatelliteStates(out[:, :3], out[:, 3:6], out[:, 6], out[:, 7], message)


def ranges(satellite: Array, receiver: Array) -> tuple[Array, Array]:
    """Return ranges (m,), m, and unit vectors (m, 3) to the satellite.

    The ranges have the Earth's rotation during the flight of the signal (Sagnac).

    Parameters
    ----------
    satellite : ndarray, shape (m, 3)
        m, ECEF at emission.
    receiver : ndarray, shape (3,) or (m, 3)
        m, ECEF at reception.
    """
    to_satellite = satellite - receiver
    distance = np.sqrt(np.einsum("mi,mi->m", to_satellite, to_satellite))
    receiver = np.broadcast_to(receiver, satellite.shape)
    sagnac = (
        GPS_EARTH_RATE
        / LIGHT
        * (satellite[:, 0] * receiver[:, 1] - satellite[:, 1] * receiver[:, 0])
    )
    return distance + sagnac, to_satellite / distance[:, None]


def sky(line_of_sight: Array, receiver: Array) -> tuple[Array, Array]:
    """Return azimuth, from north by east, and elevation (m,), rad, of unit vectors (m, 3), ECEF.

    The receiver is at (3,) or (m, 3), m, ECEF.
    """
    lat, lon, _ = ecef_to_geodetic(receiver)
    ned = np.einsum("...ij,...i->...j", rotation_en(lat, lon), line_of_sight)
    return np.arctan2(ned[:, 1], ned[:, 0]), np.arcsin(np.clip(-ned[:, 2], -1.0, 1.0))
