"""Ways of satellites' signals to a moving antenna.

Ranges and their rates, and where in the sky, and over the antenna, they come from.

A signal received at r_a(t) was sent at t - tau of system time, in axes that have since turned with
the Earth:

    rho = |Rz(w tau) r_s(t - tau) - r_a(t)| = c tau                                            (W.1)
    rho' = u (v_s - v_a) / (1 + u v_s / c)                                                     (W.2)

with u the unit vector to the satellite and both velocities v in inertial axes, where (W.2) is
exact.

Satellites move as one message of each says, through the whole flight, displaced by a constant error
of the broadcast orbit and clock that the files do not know. All messages of a `constellation` are
one orbit, and of GLONASS one message has no seams, where the integration that receivers make would
start anew.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geodesy.frames import ecef_to_geodetic, rotation_en
from ...gnss.rinex.navigation_message import TOE, Navigation
from ...gnss.satellites.orbits import satellite_states

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# m/s, rad/s (IS-GPS-200), stated here too: what is simulated borrows nothing from what corrects it
LIGHT, WGS84_EARTH_RATE = 299792458.0, 7.2921151467e-5
FLIGHT_S = 0.075  # of a signal, about
SKY_GRID_S = 60.0  # of the times at which the sky is searched
MASK_MARGIN_DEG = 1.0  # a satellite moves by half a degree between the times of the search


@dataclass(frozen=True, eq=False)
class ReceiverAntenna:
    """A receiver's antenna at n epochs.

    Parameters
    ----------
    stamp : (n,) s by its clock.
    time : (n,) s, true.
    clock_s : (n,) stamp - time.
    clock_rate : (n,), jumps left out.
    position, velocity : (n, 3) m, m/s, ECEF.
    up : (n, 3) normal of its plane, ECEF.
    bank : (n,) rad.
    """

    stamp: Array
    time: Array
    clock_s: Array
    clock_rate: Array
    position: Array
    velocity: Array
    up: Array
    bank: Array


@dataclass(frozen=True, eq=False)
class Satellites:
    """Satellites (s,) in view.

    They have a row of the navigation, frequency number, and errors of orbit (s, 3) m, ECEF, and
    clock (s,) m.
    """

    navigation: Navigation
    code: NDArray[np.str_]
    message: Index
    channel: Index
    orbit_error: Array
    clock_error: Array


@dataclass(frozen=True, eq=False)
class Paths:
    """Ways of signals, all (n, s).

    They are range m, its rate m/s, satellite clock m and its rate m/s, azimuth and elevation rad,
    and the sine of the elevation above the antenna's plane.
    """

    distance: Array
    rate: Array
    clock: Array
    clock_rate: Array
    azimuth: Array
    elevation: Array
    antenna_sine: Array


def satellites_in_view(
    navigation: Navigation,
    position: Array,
    span: tuple[float, float],
    mask_deg: float,
    error_m: float,
    rng: np.random.Generator,
) -> Satellites:
    """Satellites that stand above the mask of a place (3,) m, ECEF, within `span`, s.

    Parameters
    ----------
    error_m : sd of each axis, and of the clock.
    """
    codes = np.unique(navigation.satellite)
    age = np.abs(navigation.table[:, TOE] - 0.5 * (span[0] + span[1]))
    message = np.array(
        [min(np.flatnonzero(navigation.satellite == code), key=lambda k: age[k]) for code in codes]
    )
    grid = np.linspace(*span, 2 + int((span[1] - span[0]) / SKY_GRID_S))
    states = satellite_states(
        navigation,
        np.tile(codes, grid.size),
        np.repeat(grid, codes.size),
        np.tile(message, grid.size),
    )
    lat, lon, _ = ecef_to_geodetic(position)
    away = states.position.reshape(grid.size, codes.size, 3) - position
    sine = -(away @ rotation_en(lat, lon)[:, 2]) / np.linalg.norm(away, axis=2)
    in_view = sine.max(axis=0) > np.sin(np.radians(mask_deg - MASK_MARGIN_DEG))
    error = error_m * rng.standard_normal((int(in_view.sum()), 4))
    return Satellites(
        navigation,
        codes[in_view],
        message[in_view],
        navigation.channel[message[in_view]],
        error[:, :3],
        error[:, 3],
    )


def signal_paths(antenna: ReceiverAntenna, satellites: Satellites) -> Paths:
    """Ways of the signals of all satellites to an antenna (W.1, W.2)."""
    n, s = antenna.time.size, satellites.code.size
    codes, message = np.tile(satellites.code, n), np.tile(satellites.message, n)
    tau = np.full((n, s), FLIGHT_S)
    for _ in range(
        2
        # from a tau that is some milliseconds off to one whose error moves no satellite by more
        # than 20 micrometres
    ):
        states = satellite_states(
            satellites.navigation, codes, (antenna.time[:, None] - tau).ravel(), message
        )
        position = states.position.reshape(n, s, 3) + satellites.orbit_error
        moved = states.velocity.reshape(n, s, 3)
        tau = np.linalg.norm(_turned(position, tau) - antenna.position[:, None, :], axis=2) / LIGHT
    away = _turned(position, tau) - antenna.position[:, None, :]
    distance = np.linalg.norm(away, axis=2)
    u = away / distance[:, :, None]
    spin = np.array([0.0, 0.0, WGS84_EARTH_RATE])
    satellite_rate = np.einsum("nsi,nsi->ns", u, _turned(moved + np.cross(spin, position), tau))
    antenna_rate = np.einsum("nsi,ni->ns", u, antenna.velocity + np.cross(spin, antenna.position))
    lat, lon, _ = ecef_to_geodetic(antenna.position)
    ned = np.einsum("nsi,nij->nsj", u, rotation_en(lat, lon))
    return Paths(
        distance,
        (satellite_rate - antenna_rate) / (1.0 + satellite_rate / LIGHT),
        LIGHT * states.clock_s.reshape(n, s) + satellites.clock_error,
        LIGHT * states.drift.reshape(n, s),
        np.arctan2(ned[:, :, 1], ned[:, :, 0]),
        np.arcsin(np.clip(-ned[:, :, 2], -1.0, 1.0)),
        np.einsum("nsi,ni->ns", u, antenna.up),
    )


def _turned(vector: Array, tau: Array) -> Array:
    """Rz(w tau) of vectors (n, s, 3): from the Earth's axes of emission into those of reception."""
    sin, cos = np.sin(WGS84_EARTH_RATE * tau), np.cos(WGS84_EARTH_RATE * tau)
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    return np.stack([cos * x + sin * y, cos * y - sin * x, z], axis=-1)
