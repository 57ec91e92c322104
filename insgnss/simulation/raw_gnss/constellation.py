"""A made-up constellation of GPS and GLONASS satellites and what they broadcast.

The messages of one smooth orbit and clock each.

GPS: 31 satellites in six planes, 60 degrees apart. All messages of a satellite are the same motion,
written for other times of ephemeris t_k = 7200 s k (symbols of `gnss.orbits`):

    M0_k = M0 + (sqrt(mu / a^3) + dn)(t_k - t_0),   i0_k = i0 + i'(t_k - t_0),
    af0_k = af0 + af1 (t_k - t_0)                                                              (C.1)
    Omega0_k = Omega0 + Omega'(t_k - t_0) - w (t_k - sow_k)                                    (C.2)

with the other elements unchanged; the last term of (C.2), zero within a week, takes the elements to
the start of the week in which t_k lies. GLONASS: 24 satellites in three planes, 120 degrees apart,
eight in each, of which two that stand opposite to each other share a frequency. The state is
integrated from one start by the equations of motion of the ICD, with the acceleration of Sun and
Moon constant in the axes of the Earth (the whole multiples of 2^-30 km/s^2 of which the message is
made), so that it depends on no spacing of messages, t_k = 1800 s k + 900 s of UTC.

IS-GPS-200 20.3.3.4.3 and table 20-IV; GLONASS ICD 5.1 A.3.1.2 and 4.4. Slots, eccentricities,
corrections and clocks are drawn in the ranges of broadcast ones: eccentricity 0.001 to 0.02, clocks
to 0.5 ms and some 1e-12 of rate; frequency numbers are those in use.
"""

import numpy as np

from ...base.errors import UsageError
from ...geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S, leap_seconds
from ...gnss.rinex.navigation_message import (
    AF0,
    AF1,
    CIC,
    CIS,
    CRC,
    CRS,
    CUC,
    CUS,
    DELTA_N,
    ECC,
    GLONASS,
    I0,
    I_DOT,
    KEPLER,
    KIND,
    M0,
    MESSAGE_VALUES,
    MU,
    NODE0,
    NODE_DOT,
    PERIGEE,
    RATE,
    ROOT_A,
    SOW,
    STATE,
    TOC,
    TOE,
    Navigation,
)
from ...gnss.rinex.systems import CONSTANTS
from ...gnss.satellites.constants import PZ90_A, PZ90_J2, PZ90_MU, PZ90_RATE
from ...records import Array

GPS_SPACING_S, GLONASS_SPACING_S = 7200.0, 1800.0  # of messages: every two hours, half an hour
GPS_PER_PLANE = (5, 5, 5, 5, 5, 6)  # satellites in each plane, 31 in all
GPS_AXIS_M, GLONASS_AXIS_M = 26.5597e6, 25.5082e6  # semi-major: 1/2 and 8/17 of a sidereal day
# of the 24 slots, as the system has them: satellites opposite each other share a frequency
GLONASS_CHANNELS = (*2 * (1, -4, 5, 6), *2 * (-2, -7, 0, -1), *2 * (4, -3, 3, 2))
LUNISOLAR_STEP = 2.0**-30 * 1e3  # m/s^2, of the message
LONGEST_SPAN_S = 86400.0  # of one constellation (chosen): a day


def constellation(
    gps_week: int, start_tow: float, end_tow: float, systems: str = "GR", seed: int = 0
) -> Navigation:
    """Return the messages of all satellites in order of their time of ephemeris.

    They are those from `start_tow` to `end_tow`, s of `gps_week`, GPST.

    Any instant between is within an hour (GLONASS: a quarter) of a message of each satellite.

    Parameters
    ----------
    systems : of G and R.

    Raises
    ------
    UsageError
        For another system, for times that are none of a flight, and for a negative seed.
    """
    if not systems or set(systems) - set("GR") or seed < 0:
        raise UsageError(
            f"constellation of systems {systems!r}, seed {seed}; systems are of G (GPS) and R"
            " (GLONASS), the seed 0 or more"
        )
    if not 0.0 <= end_tow - start_tow <= LONGEST_SPAN_S:
        raise UsageError(
            f"constellation from {start_tow} to {end_tow} s; give a span of at most"
            f" {LONGEST_SPAN_S:.0f} s, its start first"
        )
    gps, glonass = (np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(2))
    satellite: list[str] = []
    tables: list[Array] = []
    if "G" in systems:
        toe = _grid(start_tow, end_tow, GPS_SPACING_S, 0.0)
        for number, elements in enumerate(_gps_elements(toe[0], gps), start=1):
            satellite += [f"G{number:02d}"] * toe.size
            tables.append(_kepler_messages(elements, toe))
    if "R" in systems:
        utc = 0.5 * GLONASS_SPACING_S + float(
            leap_seconds(GPS_EPOCH_UNIX_S + gps_week * WEEK_S + start_tow)
        )
        toe = _grid(start_tow, end_tow, GLONASS_SPACING_S, utc)
        for number, messages in enumerate(_glonass_messages(toe, glonass), start=1):
            satellite += [f"R{number:02d}"] * toe.size
            tables.append(messages)
    names, table = np.array(satellite), np.concatenate(tables)
    channel = np.array(
        [GLONASS_CHANNELS[int(name[1:]) - 1] if name[0] == "R" else 0 for name in names],
        dtype=np.int64,
    )
    order = np.argsort(table[:, TOE], kind="stable")
    return Navigation(
        names[order], table[order], channel[order], gps_week, "simulated constellation"
    )


def _grid(start: float, end: float, spacing: float, offset: float) -> Array:
    """Multiples of `spacing` past `offset` that enclose start and end."""
    first, last = np.floor((start - offset) / spacing), np.ceil((end - offset) / spacing)
    return np.arange(first, max(last, first + 1.0) + 0.5) * spacing + offset


def _gps_elements(toe: float, rng: np.random.Generator) -> Array:
    """(31, MESSAGE_VALUES) elements at `toe`, sow and toc as if it lay in the week."""
    plane = np.repeat(np.arange(len(GPS_PER_PLANE)), GPS_PER_PLANE)
    slot = np.concatenate([np.arange(count) / count for count in GPS_PER_PLANE])
    n = plane.size

    def normal(mean: float, sd: float) -> Array:
        return np.asarray(mean + sd * rng.standard_normal(n))

    row = np.zeros((n, MESSAGE_VALUES))
    row[:, KIND], row[:, TOE], row[:, TOC], row[:, SOW] = KEPLER, toe, toe, toe
    row[:, MU], row[:, RATE] = CONSTANTS["G"]
    row[:, AF0], row[:, AF1] = rng.uniform(-5e-4, 5e-4, n), normal(0.0, 4e-12)
    row[:, ROOT_A] = np.sqrt(normal(GPS_AXIS_M, 2e3))
    row[:, ECC] = np.exp(rng.uniform(np.log(1e-3), np.log(2e-2), n))
    row[:, PERIGEE] = rng.uniform(-np.pi, np.pi, n)
    latitude_argument = 2.0 * np.pi * (slot + plane / 9.0) + normal(0.0, 0.08)
    row[:, M0] = _turn(latitude_argument - row[:, PERIGEE])
    row[:, I0], row[:, I_DOT] = np.radians(normal(55.0, 0.7)), normal(0.0, 2e-10)
    row[:, NODE0] = rng.uniform(0.0, 2.0 * np.pi) + np.pi / 3.0 * plane + normal(0.0, 0.03)
    row[:, NODE_DOT], row[:, DELTA_N] = normal(-8.0e-9, 2e-10), normal(4.6e-9, 3e-10)
    row[:, CUC] = normal(0.0, 3e-6)
    row[:, CUS] = normal(6e-6, 3e-6)
    row[:, CRC] = normal(230.0, 60.0)
    row[:, CRS] = normal(0.0, 60.0)
    row[:, CIC], row[:, CIS] = normal(0.0, 1e-7), normal(0.0, 1e-7)
    return row


def _kepler_messages(elements: Array, toe: Array) -> Array:
    """Messages (k, MESSAGE_VALUES) of `elements` (MESSAGE_VALUES,) at toe (k,) s (C.1, C.2).

    toe is of the first one's week.
    """
    row = np.tile(elements, (toe.size, 1))
    since = toe - elements[TOE]
    row[:, M0] = _turn(
        row[:, M0] + (np.sqrt(row[:, MU] / row[:, ROOT_A] ** 6) + row[:, DELTA_N]) * since
    )
    row[:, I0] += row[:, I_DOT] * since
    row[:, AF0] += row[:, AF1] * since
    row[:, TOE] = row[:, TOC] = toe
    row[:, SOW] = toe % WEEK_S
    row[:, NODE0] = _turn(
        row[:, NODE0] + row[:, NODE_DOT] * since - row[:, RATE] * (toe - row[:, SOW])
    )
    return row


def _turn(angle: Array) -> Array:
    """The angle within half a turn of zero."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def _glonass_messages(toe: Array, rng: np.random.Generator) -> Array:
    """(24, k, MESSAGE_VALUES) messages at toe (k,) s: states of orbits that start at the first."""
    n = len(GLONASS_CHANNELS)
    position, velocity = _glonass_start(rng)
    lunisolar: Array = LUNISOLAR_STEP * rng.integers(-3, 4, (n, 3)).astype(np.float64)
    af0, af1 = rng.uniform(-2e-4, 2e-4, n), 1e-12 * rng.standard_normal(n)
    row = np.zeros((n, toe.size, MESSAGE_VALUES))
    row[:, :, KIND] = GLONASS
    row[:, :, TOE] = row[:, :, TOC] = toe
    row[:, :, AF1] = af1[:, None]
    row[:, :, AF0] = af0[:, None] + af1[:, None] * (toe - toe[0])
    row[:, :, STATE : STATE + 6] = _integrated(
        np.hstack([position, velocity]), lunisolar, toe - toe[0]
    )
    row[:, :, STATE + 6 : STATE + 9] = lunisolar[:, None, :]
    return row


def _glonass_start(rng: np.random.Generator) -> tuple[Array, Array]:
    """Positions and velocities (24, 3), m and m/s, in the axes of the Earth, of near circles.

    The planes are those of table 4.4 of the ICD.
    """
    plane, slot = np.divmod(np.arange(24), 8)
    ecc, perigee = rng.uniform(1e-4, 2e-3, 24), rng.uniform(0.0, 2.0 * np.pi, 24)
    axis = GLONASS_AXIS_M + 1e3 * rng.standard_normal(24)
    u = np.radians(-45.0 * slot + 15.0 * plane) + 0.01 * rng.standard_normal(24)
    incl = np.radians(64.8 + 0.3 * rng.standard_normal(24))
    node = (
        rng.uniform(0.0, 2.0 * np.pi) + 2.0 * np.pi / 3.0 * plane + 0.01 * rng.standard_normal(24)
    )
    true = u - perigee
    p = axis * (1.0 - ecc**2)
    r = p / (1.0 + ecc * np.cos(true))
    radial = np.sqrt(PZ90_MU / p) * ecc * np.sin(true)
    across = np.sqrt(PZ90_MU / p) * (1.0 + ecc * np.cos(true))
    toward = _in_plane(u, incl, node)
    ahead = _in_plane(u + 0.5 * np.pi, incl, node)
    position = r[:, None] * toward
    velocity = radial[:, None] * toward + across[:, None] * ahead
    return position, velocity - np.cross([0.0, 0.0, PZ90_RATE], position)


def _in_plane(u: Array, incl: Array, node: Array) -> Array:
    """(n, 3) unit vectors at arguments of latitude u in planes of inclination and node."""
    su = np.sin(u)
    cu = np.cos(u)
    si = np.sin(incl)
    ci = np.cos(incl)
    sn = np.sin(node)
    cn = np.cos(node)
    return np.stack([cn * cu - sn * su * ci, sn * cu + cn * su * ci, su * si], axis=-1)


def _integrated(start: Array, lunisolar: Array, elapsed: Array) -> Array:
    """States (n, k, 6) at `elapsed` (k,) s from 0, in order, of satellites from `start` (n, 6)."""
    from scipy.integrate import solve_ivp

    def rate(_: float, flat: Array) -> Array:
        y = flat.reshape(-1, 6)
        r, v = y[:, :3], y[:, 3:]
        r2 = np.einsum("ni,ni->n", r, r)
        central = -PZ90_MU / r2**1.5
        oblate = 1.5 * PZ90_J2 * PZ90_MU * PZ90_A**2 / r2**2.5
        share = 1.0 - 5.0 * r[:, 2] ** 2 / r2
        a = (central - oblate * share)[:, None] * r + lunisolar
        a[:, 2] -= 2.0 * oblate * r[:, 2]
        a[:, 0] += PZ90_RATE**2 * r[:, 0] + 2.0 * PZ90_RATE * v[:, 1]
        a[:, 1] += PZ90_RATE**2 * r[:, 1] - 2.0 * PZ90_RATE * v[:, 0]
        return np.hstack([v, a]).ravel()

    solved = solve_ivp(
        rate, (0.0, float(elapsed[-1])), start.ravel(), "DOP853", elapsed, rtol=1e-12, atol=1e-9
    )
    return np.asarray(solved.y.reshape(-1, 6, elapsed.size).transpose(0, 2, 1))
