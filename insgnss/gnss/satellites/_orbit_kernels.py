"""Loops over broadcast messages: satellite position, velocity, clock and clock drift in ECEF;
formulas in :mod:`insgnss.gnss.satellites.orbits`.

A message is one row of the table of :mod:`insgnss.gnss.rinex.navigation_message`, whose names of
columns are used here.
"""

import numpy as np
from numpy.typing import NDArray

from ...base.compilation import njit
from ..rinex.navigation_message import (
    AF0,
    AF1,
    AF2,
    CIC,
    CIS,
    CRC,
    CRS,
    CUC,
    CUS,
    DELTA_N,
    ECC,
    GEOSTATIONARY,
    GLONASS,
    I0,
    I_DOT,
    KIND,
    M0,
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
)
from .constants import LIGHT, PZ90_A, PZ90_J2, PZ90_MU, PZ90_RATE

Array = NDArray[np.float64]
Index = NDArray[np.int64]

GLONASS_STEP_S = 60.0  # of Runge and Kutta: RTKLIB's TSTEP
GEO_TILT = np.radians(-5.0)  # of the plane that BeiDou's geostationary elements count from (ICD)


@njit(cache=True, error_model="numpy")
def _eccentric(mean: float, ecc: float) -> float:
    """Eccentric anomaly, rad, of Kepler's equation by Newton's method."""
    anomaly = mean
    for _ in range(12):
        step = (anomaly - ecc * np.sin(anomaly) - mean) / (1.0 - ecc * np.cos(anomaly))
        anomaly -= step
        if abs(step) < 1e-14:
            break
    return anomaly


@njit(cache=True, error_model="numpy")
def _kepler(p: Array, t: float, out: Array) -> None:
    """Fill out (8,) position, velocity, clock, drift of the message `p` at `t`, s (O.1 to O.6)."""
    axis = p[ROOT_A] * p[ROOT_A]
    motion = np.sqrt(p[MU] / axis**3) + p[DELTA_N]
    tk = t - p[TOE]
    E = _eccentric(p[M0] + motion * tk, p[ECC])
    sE, cE = np.sin(E), np.cos(E)
    E_dot = motion / (1.0 - p[ECC] * cE)
    root = np.sqrt(1.0 - p[ECC] * p[ECC])
    argument = np.arctan2(root * sE, cE - p[ECC]) + p[PERIGEE]
    argument_dot = root * E_dot / (1.0 - p[ECC] * cE)
    s2, c2 = np.sin(2.0 * argument), np.cos(2.0 * argument)
    u = argument + p[CUS] * s2 + p[CUC] * c2
    u_dot = argument_dot * (1.0 + 2.0 * (p[CUS] * c2 - p[CUC] * s2))
    r = axis * (1.0 - p[ECC] * cE) + p[CRS] * s2 + p[CRC] * c2
    r_dot = axis * p[ECC] * sE * E_dot + 2.0 * argument_dot * (p[CRS] * c2 - p[CRC] * s2)
    i = p[I0] + p[I_DOT] * tk + p[CIS] * s2 + p[CIC] * c2
    i_dot = p[I_DOT] + 2.0 * argument_dot * (p[CIS] * c2 - p[CIC] * s2)
    geo = p[KIND] == GEOSTATIONARY
    node_dot = p[NODE_DOT] if geo else p[NODE_DOT] - p[RATE]
    node = p[NODE0] + node_dot * tk - p[RATE] * p[SOW]
    su, cu, sn, cn, si, ci = np.sin(u), np.cos(u), np.sin(node), np.cos(node), np.sin(i), np.cos(i)
    x, y = r * cu, r * su
    x_dot, y_dot = r_dot * cu - y * u_dot, r_dot * su + x * u_dot
    out[0] = x * cn - y * ci * sn
    out[1] = x * sn + y * ci * cn
    out[2] = y * si
    across = y_dot * ci - y * si * i_dot
    out[3] = x_dot * cn - across * sn - out[1] * node_dot
    out[4] = x_dot * sn + across * cn + out[0] * node_dot
    out[5] = y_dot * si + y * ci * i_dot
    if geo:
        _turn_geostationary(p[RATE], tk, out)
    tc = t - p[TOC]
    relativity = -2.0 * np.sqrt(p[MU]) / (LIGHT * LIGHT) * p[ECC] * p[ROOT_A]
    out[6] = p[AF0] + p[AF1] * tc + p[AF2] * tc * tc + relativity * sE
    out[7] = p[AF1] + 2.0 * p[AF2] * tc + relativity * cE * E_dot


@njit(cache=True, error_model="numpy")
def _turn_geostationary(rate: float, tk: float, out: Array) -> None:
    """Turn position and velocity of a BeiDou GEO message from its tilted inertial axes into ECEF:
    Rz(rate tk) Rx(-5 deg) (O.7).
    """
    st, ct = np.sin(GEO_TILT), np.cos(GEO_TILT)
    sa, ca = np.sin(rate * tk), np.cos(rate * tk)
    for k in (0, 3):
        x, y, z = out[k], out[k + 1], out[k + 2]
        y, z = ct * y + st * z, ct * z - st * y
        out[k], out[k + 1], out[k + 2] = ca * x + sa * y, ca * y - sa * x, z
    out[3] += rate * out[1]
    out[4] -= rate * out[0]


@njit(cache=True, error_model="numpy")
def _glonass_rate(y: Array, p: Array, dy: Array) -> None:
    """Derivative dy (6,) of the GLONASS state y (6,) in rotating PZ-90 axes (O.8)."""
    r2 = y[0] * y[0] + y[1] * y[1] + y[2] * y[2]
    r3 = r2 * np.sqrt(r2)
    w2 = PZ90_RATE * PZ90_RATE
    a = 1.5 * PZ90_J2 * PZ90_MU * PZ90_A * PZ90_A / (r2 * r3)
    b = 5.0 * y[2] * y[2] / r2
    c = -PZ90_MU / r3 - a * (1.0 - b)
    dy[0], dy[1], dy[2] = y[3], y[4], y[5]
    dy[3] = (c + w2) * y[0] + 2.0 * PZ90_RATE * y[4] + p[STATE + 6]
    dy[4] = (c + w2) * y[1] - 2.0 * PZ90_RATE * y[3] + p[STATE + 7]
    dy[5] = (c - 2.0 * a) * y[2] + p[STATE + 8]


@njit(cache=True, error_model="numpy")
def _glonass(p: Array, t: float, out: Array, work: Array) -> None:
    """Fill out (8,) position, velocity, clock, drift of the GLONASS message `p` at `t`, s:
    Runge-Kutta of fourth order; work (4, 6).
    """
    y, z, k, total = work[0], work[1], work[2], work[3]
    for j in range(6):
        y[j] = p[STATE + j]
    remaining = t - p[TOE]
    steps = max(1, int(np.ceil(abs(remaining) / GLONASS_STEP_S)))
    h = remaining / steps
    for _ in range(steps):
        for j in range(6):
            z[j], total[j] = y[j], 0.0
        for stage in range(4):
            _glonass_rate(z, p, k)
            ahead = h if stage == 2 else 0.5 * h
            for j in range(6):
                total[j] += k[j] if stage == 0 or stage == 3 else 2.0 * k[j]
                z[j] = y[j] + ahead * k[j]
        for j in range(6):
            y[j] += h / 6.0 * total[j]
    for j in range(6):
        out[j] = y[j]
    out[6] = p[AF0] + p[AF1] * (t - p[TOC])
    out[7] = p[AF1]


@njit(cache=True, error_model="numpy")
def states(table: Array, message: Index, time: Array, pseudorange: Array, out: Array) -> None:
    """Fill out (m, 8) of the rows `message` (m,) of table (k, COLUMNS).

    It is not-a-number where message is negative.
    time (m,), s: the instants, where pseudorange (0,) is empty; else of reception by the receiver's
    clock, and the instant is that of emission (O.9), pseudorange (m,) m.
    """
    work = np.empty((4, 6))
    for i in range(time.size):
        if message[i] < 0 or (pseudorange.size > 0 and not np.isfinite(pseudorange[i])):
            for j in range(8):
                out[i, j] = np.nan
            continue
        p = table[message[i]]
        t = time[i]
        if pseudorange.size > 0:
            t -= pseudorange[i] / LIGHT
            since = t - p[TOC]
            t -= p[AF0] + p[AF1] * since + p[AF2] * since * since
        if p[KIND] == GLONASS:
            _glonass(p, t, out[i], work)
        else:
            _kepler(p, t, out[i])
