"""A made-up constellation as RINEX navigation text, for tests: no recording is in it."""

from datetime import datetime, timedelta

import numpy as np

START = datetime(2024, 3, 6, 12, 0, 0)  # GPST; week 2304, Wednesday
WEEK, TOW = 2304, 302400.0
GPS_AXIS, GALILEO_AXIS, BEIDOU_GEO_AXIS = 26.56e6, 29.6e6, 42164.17e3


def number(value):
    return f"{value:19.12E}".replace("E", "D")


def header(version, what, system):
    first = f"{version:9.2f}           {what:20s}{system:20s}RINEX VERSION / TYPE\n"
    return first + f"{'':60s}END OF HEADER\n"


def gps_elements(
    axis=GPS_AXIS, ecc=0.0, incl=0.96, node=0.0, perigee=0.0, anomaly=0.0, toe=TOW, **more
):
    """The 26 numbers behind the clock's, IODE first."""
    value = {
        "crs": 0.0,
        "dn": 0.0,
        "cuc": 0.0,
        "cus": 0.0,
        "cic": 0.0,
        "cis": 0.0,
        "crc": 0.0,
        "node_dot": 0.0,
        "idot": 0.0,
    } | more
    first = [
        1.0,
        value["crs"],
        value["dn"],
        anomaly,
        value["cuc"],
        ecc,
        value["cus"],
        np.sqrt(axis),
        toe,
        value["cic"],
        node,
        value["cis"],
    ]
    second = [
        incl,
        value["crc"],
        perigee,
        value["node_dot"],
        value["idot"],
        value.get("source", 0.0),
        WEEK,
        0.0,
    ]
    return [*first, *second, 2.0, value.get("health", 0.0), 0.0, 1.0, toe - 600.0, 4.0]


def message(version, satellite, clock, values, when=START):
    """One message of `values` behind the clock's three."""
    if version < 3:
        stamp = f"{int(satellite[1:]):2d} {when:%y %m %d %H %M}{when.second:5.1f}"
        indent = "   "
    else:
        stamp, indent = f"{satellite} {when:%Y %m %d %H %M %S}", "    "
    lines = [stamp + "".join(number(value) for value in clock)]
    for k in range(0, len(values), 4):
        lines.append(indent + "".join(number(value) for value in values[k : k + 4]))
    return "\n".join(lines) + "\n"


def glonass_elements(position, velocity, channel, acceleration=(0.0, 0.0, 0.0), health=0.0):
    """The twelve numbers behind the clock's, km."""
    last = (health, float(channel), 0.0)
    return [
        value
        for k in range(3)
        for value in (position[k] / 1e3, velocity[k] / 1e3, acceleration[k] / 1e3, last[k])
    ]


def constellation(version=3.04):
    """24 GPS-like satellites in six planes, of some eccentricity, and 8 Galileo ones: RINEX 3 text,
    valid for two hours from START.
    """
    text = header(version, "N: GNSS NAV DATA", "M: MIXED")
    toe, when = TOW + 3600.0, START + timedelta(hours=1)
    for k in range(24):
        more = {
            "ecc": 0.004 + 0.0005 * k,
            "node": k // 4 * np.pi / 3.0,
            "anomaly": k % 4 * np.pi / 2.0 + k // 4 * 0.6,
            "perigee": 0.3 * k,
        }
        more |= {
            "cus": 4e-6,
            "cuc": -2e-6,
            "crc": 200.0,
            "crs": -60.0,
            "cis": 1e-7,
            "cic": -8e-8,
            "idot": 2e-10,
            "node_dot": -8e-9,
        }
        clock = (1e-5 * (k - 12), 1e-11 * (k % 5 - 2), 0.0)
        text += message(version, f"G{k + 1:02d}", clock, gps_elements(toe=toe, **more), when)
    for k in range(8):
        more = {
            "axis": GALILEO_AXIS,
            "ecc": 2e-4,
            "node": k % 2 * 1.1,
            "anomaly": k * 0.8,
            "source": 517.0,
        }
        text += message(
            version, f"E{k + 1:02d}", (2e-4, -3e-12, 0.0), gps_elements(toe=toe, **more), when
        )
    return text
