"""Heights of the standard atmosphere."""

import pytest

from insgnss.geodesy.atmosphere import standard_height

# ISO 2533:1975, table 5: geopotential height m, pressure Pa
TABLE = [(-500.0, 107477.0), (0.0, 101325.0), (1000.0, 89874.6), (3000.0, 70108.5)]


@pytest.mark.parametrize(("height", "pressure"), TABLE)
def test_heights_are_those_of_the_standard_atmosphere(height, pressure):
    """Oracle: the printed table; the last printed digit of a pressure is 0.01 m at most up to 3 km,
    0.05 m where it is a whole pascal.
    """
    assert float(standard_height(pressure)) == pytest.approx(height, abs=0.06)
