"""Precise orbits (SP3), read by georinex, as the text of RINEX 3.04 that all else here reads.

An SP3 file holds positions and clocks every 5 or 15 minutes. To those within `FIT_HALF_WINDOW_S` of
every full hour the elements of a broadcast message are fitted by least squares, the clock by a
line, so that engine and velocities take them as they take any message. What a fit leaves is told;
GLONASS and geostationary BeiDou, which other equations hold for, and satellites without a clock are
left out. Positions of SP3 are of the centre of mass, up to 2 m from the antenna: that moves a rover
by 1 mm 10 km from its base.
"""

import io
import warnings
from collections import Counter
from functools import lru_cache
from pathlib import Path
from types import ModuleType

import numpy as np

from ...base.errors import InputError, required_library, words_of
from ...base.wording import DOCTOR
from ...geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S, calendar_from_gps
from ...records import Array
from .systems import BEIDOU_LAG_S, CONSTANTS, is_geostationary

# of a fit's window (s): 3600, since elements that hold for two hours miss by cm
FIT_HALF_WINDOW_S = 3600.0
LEAST_NODES = 7  # positions in a window: 21 coordinates and more for 15 elements
LARGEST_MISS_M = 1.0  # rms of a fit (m): 1, as broadcast orbits have; beyond it, a manoeuvre
# of Gauss and Newton: 4, the last of which moves a satellite by less than 1 mm
GAUSS_NEWTON_STEPS = 4
NO_CLOCK_US = 999999.0  # clocks without a value (us): 999999 and more, as SP3 says
GPS_WEEKS_OF = {"C": -1356}  # GPS weeks before the first of BeiDou, which began in 2006
SOURCE_OF_SYSTEM = {"E": 517.0}  # I/NAV of E1-B with clocks of E1 and E5b
# elements in the order of a fit, with a step (rad, m, 1) that moves a satellite by metres
ELEMENTS = {"root_a": 1e-4, "ecc": 1e-7, "m0": 1e-7, "dn": 1e-11, "i0": 1e-7, "idot": 1e-11}
ELEMENTS |= {"node": 1e-7, "node_dot": 1e-11, "perigee": 1e-7, "cuc": 1e-7, "cus": 1e-7}
ELEMENTS |= {"crc": 1.0, "crs": 1.0, "cic": 1e-7, "cis": 1e-7}
# numbers of a message behind the clock's three, by name; those without one are zero
MESSAGE_NAMES = (
    "iode crs dn m0 cuc ecc cus root_a sow cic node cis i0 crc perigee node_dot idot source"
)
MESSAGE_NAMES += " week - - health - - sent fit"
NAVIGATION_HEAD = (
    f"{'     3.04           N: GNSS NAV DATA    M: MIXED':60}RINEX VERSION / TYPE",
    f"{'':60}END OF HEADER",
)


MOST_ORDER = 8  # of the polynomials through the positions of a message (chosen)
KEPLER_STEPS = 6  # of Newton on Kepler's equation (chosen)
RANK_TOLERANCE = 1e-9  # of singular values over the largest, below which elements are not moved


def message_lines(begin: str, values: list[float]) -> list[str]:
    """Return the lines of a message that begins so: three numbers, then four a line."""
    fields = [f"{np.nan_to_num(x):19.12E}" for x in values]
    continuations = ["    " + "".join(fields[k : k + 4]) for k in range(3, len(values), 4)]
    return [begin + "".join(fields[:3]), *continuations]


def library(path: str | Path, kind: str) -> ModuleType:
    """Return georinex; InputError for a file of this `kind` where it is not installed."""
    with required_library(
        f"{kind} is read by georinex: pip install 'insgnss[ppk]'; {DOCTOR}", path
    ):
        import georinex
    return georinex


@lru_cache(maxsize=4)  # read for the engine and for its checks
def messages_of_sp3(path: str | Path, text: str) -> tuple[tuple[str, ...], Counter[str]]:
    """Return broadcast messages fitted to precise orbits as lines of RINEX 3.04.

    Parameters
    ----------
    path : path-like
        The file, for messages.
    text : str
        Its text.

    Returns
    -------
    lines : tuple of str
        A message an hour and satellite.
    left_out : Counter
        Satellites that were left out, by reason.

    Raises
    ------
    InputError
        Where georinex cannot read it, its times are not GPST, or nothing can be fitted.
    """
    georinex = library(path, "SP3")
    scale = next((line[9:12] for line in text.splitlines() if line.startswith("%c")), "GPS")
    if scale not in ("GPS", "ccc", "   "):
        message = f"times of SP3 in {scale}; GPS time is read, convert it"
        raise InputError.in_file(path, message)
    try:
        with warnings.catch_warnings(action="ignore"):
            table = georinex.load_sp3(io.StringIO(text), None)
    except (AssertionError, ValueError, IndexError) as error:
        message = f"georinex cannot read this file: {words_of(error)}; fetch the file again"
        raise InputError.in_file(path, message) from None
    time = table.time.values.astype("datetime64[ns]").astype(np.int64) / 1e9 - GPS_EPOCH_UNIX_S
    position, clock = 1e3 * table.position.values, 1e-6 * table.clock.values
    position[(position == 0.0).all(axis=2)] = np.nan
    clock[np.abs(clock) >= 1e-6 * NO_CLOCK_US] = np.nan
    lines, left_out = [*NAVIGATION_HEAD], Counter[str]()
    for k, satellite in enumerate(table.sv.values.astype(str)):
        if satellite[0] not in CONSTANTS or is_geostationary(satellite):
            left_out["satellites of SP3 whose orbits are no Kepler elements"] += 1
            continue
        finite = np.isfinite(position[:, k]).all(axis=1) & np.isfinite(clock[:, k])
        fitted = _fit_messages(satellite, time[finite], position[finite, k], clock[finite, k])
        left_out["satellites of SP3 to which no elements could be fitted"] += not fitted
        lines += fitted
    if len(lines) == len(NAVIGATION_HEAD):
        message = f"no orbit of an hour at least in {time.size} epochs; give the SP3 of the day"
        raise InputError.in_file(path, message)
    return tuple(lines), +left_out


def _fit_messages(satellite: str, time: Array, position: Array, clock: Array) -> list[str]:
    """Return messages, an hour each, fitted to positions (n, 3), m, and clocks (n,), s."""
    if time.size < LEAST_NODES:
        return []
    system, lines = satellite[0], list[str]()
    mu, rate = CONSTANTS[system]
    first_hour, last_hour = time[[0, -1]] / FIT_HALF_WINDOW_S
    hours = np.arange(np.ceil(first_hour), np.floor(last_hour) + 1.0) * FIT_HALF_WINDOW_S
    inside = hours[(hours >= time[0] + FIT_HALF_WINDOW_S) & (hours <= time[-1] - FIT_HALF_WINDOW_S)]
    for toe in inside if inside.size else hours[hours.size // 2 : hours.size // 2 + 1]:
        within = np.abs(time - toe) <= FIT_HALF_WINDOW_S
        if within.sum() < LEAST_NODES:
            continue
        elements, rms_m = _fit_elements(time[within] - toe, position[within], mu, rate)
        if not rms_m < LARGEST_MISS_M:
            continue
        week, sow = divmod(toe - (BEIDOU_LAG_S if system == "C" else 0.0), WEEK_S)
        elements["node"] = (elements["node"] + rate * sow + np.pi) % (2.0 * np.pi) - np.pi
        drift, bias = np.polyfit(time[within] - toe, clock[within], 1)
        elements |= {"sow": sow, "sent": sow, "week": week + GPS_WEEKS_OF.get(system, 0)}
        elements |= {"fit": 4.0, "source": SOURCE_OF_SYSTEM.get(system, 0.0)}
        elements["iode"] = float(len(lines) // 8 % 255)
        stamp = calendar_from_gps(int(week), sow, "gpst")
        values = [bias, drift, 0.0, *(elements.get(name, 0.0) for name in MESSAGE_NAMES.split())]
        lines += message_lines(f"{satellite} {stamp:%Y %m %d %H %M %S}", values)
    return lines


def _fit_elements(
    tk: Array, position: Array, mu: float, rate: float
) -> tuple[dict[str, float], float]:
    """Return elements fitted to positions (n, 3), m ECEF, at `tk` (n,), s from toe, and the rms, m.

    `node` is that at toe in ECEF.
    """
    elements = _osculating_elements(tk, position, mu, rate)
    step = np.array([*ELEMENTS.values()])
    for _ in range(GAUSS_NEWTON_STEPS):
        model, *moved = _positions_of_elements(
            elements + np.vstack([0.0 * step, np.diag(step)]), tk, mu, rate
        )
        jacobian = (np.stack(moved) - model).reshape(step.size, -1).T
        elements = elements + step * (
            np.linalg.pinv(jacobian, rcond=RANK_TOLERANCE) @ (position - model).ravel()
        )
    rms_m = float(
        np.sqrt(np.mean((position - _positions_of_elements(elements[None], tk, mu, rate)[0]) ** 2))
    )
    return dict(zip(ELEMENTS, elements.tolist(), strict=True)), rms_m


def _osculating_elements(tk: Array, position: Array, mu: float, rate: float) -> Array:
    """Return the Kepler elements (15,) of position and velocity at toe, the harmonics zero."""
    order = min(MOST_ORDER, tk.size - 1)
    half_width = np.abs(tk).max()
    terms = np.polynomial.polynomial.polyfit(tk / half_width, position, order)
    r = terms[0]
    v = terms[1] / half_width + np.cross([0.0, 0.0, rate], r)
    h = np.cross(r, v)
    radius = float(np.linalg.norm(r))
    semi_major = 1.0 / (2.0 / radius - v @ v / mu)
    e_vector = np.cross(v, h) / mu - r / radius
    ecc = float(np.linalg.norm(e_vector))
    node = np.arctan2(h[0], -h[1])
    i0 = np.arctan2(np.hypot(h[0], h[1]), h[2])
    to_node = np.array([np.cos(node), np.sin(node), 0.0])
    in_plane = np.cross(h / np.linalg.norm(h), to_node)
    perigee = np.arctan2(e_vector @ in_plane, e_vector @ to_node)
    anomaly = np.arctan2(
        r @ v / np.sqrt(mu * semi_major), 1.0 - radius / semi_major
    )  # e sin E, e cos E
    elements = dict.fromkeys(ELEMENTS, 0.0) | {"root_a": semi_major**0.5, "ecc": ecc, "i0": i0}
    elements |= {"node": node, "perigee": perigee, "m0": anomaly - ecc * np.sin(anomaly)}
    return np.array([*elements.values()])


def _positions_of_elements(p: Array, tk: Array, mu: float, rate: float) -> Array:
    """Return positions (k, n, 3), m ECEF, of elements (k, 15) by (O.1) to (O.5) of `orbits`."""
    e = dict(zip(ELEMENTS, p.T[:, :, None], strict=True))
    mean = e["m0"] + (np.sqrt(mu) / e["root_a"] ** 3 + e["dn"]) * tk
    E = mean
    for _ in range(KEPLER_STEPS):
        E = E - (E - e["ecc"] * np.sin(E) - mean) / (1.0 - e["ecc"] * np.cos(E))
    phi = np.arctan2(np.sqrt(1.0 - e["ecc"] ** 2) * np.sin(E), np.cos(E) - e["ecc"]) + e["perigee"]
    s, c = np.sin(2.0 * phi), np.cos(2.0 * phi)
    u = phi + e["cus"] * s + e["cuc"] * c
    r = e["root_a"] ** 2 * (1.0 - e["ecc"] * np.cos(E)) + e["crs"] * s + e["crc"] * c
    i = e["i0"] + e["idot"] * tk + e["cis"] * s + e["cic"] * c
    node = e["node"] + (e["node_dot"] - rate) * tk
    x, y, across = r * np.cos(u), r * np.sin(u), np.cos(i)
    sn, cn = np.sin(node), np.cos(node)
    return np.stack([x * cn - y * across * sn, x * sn + y * across * cn, y * np.sin(i)], axis=2)
