"""What the interface documents of the satellite systems prescribe for their messages."""

# gravitational constant, m^3/s^2, and rotation of the Earth, rad/s
CONSTANTS = {
    "G": (3.986005e14, 7.2921151467e-5),
    "J": (3.986005e14, 7.2921151467e-5),
    "E": (3.986004418e14, 7.2921151467e-5),
    "C": (3.986004418e14, 7.292115e-5),
}
BEIDOU_LAG_S = 14.0  # of BeiDou time behind GPST: leap seconds from 1980 to 2006


def is_geostationary(satellite: str) -> bool:
    """Return whether a BeiDou satellite is geostationary, which its number says."""
    return satellite[0] == "C" and not 5 < int(satellite[1:]) < 59
