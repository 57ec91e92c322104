"""Constants of nature and of reference systems that orbits and signals of satellites rest on."""

LIGHT = 299792458.0  # m/s

# Of the reference system of GLONASS (PZ-90.11): gravitation, equatorial radius, oblateness,
# rotation.
# m^3/s^2, m, rad/s
PZ90_MU, PZ90_A, PZ90_J2, PZ90_RATE = 3.986004418e14, 6378136.0, 1.0826257e-3, 7.292115e-5
