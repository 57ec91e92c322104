"""A base that loses and regains satellites, seconds apart, under a rover of five times its rate:
what the engine makes of it.
"""

from importlib.util import find_spec

import numpy as np
import pytest

from insgnss.geodesy.frames import geodetic_to_ecef
from insgnss.gnss.engine.rtklib import solve
from insgnss.gnss.options import EngineOptions
from insgnss.io.formats.gnss.rtklib_pos import read_rtklib_pos
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.raw_gnss.errors import Tracking
from insgnss.simulation.raw_gnss.options import RawGnssOptions

RECEIVERS = RawGnssOptions(
    rate_hz=5.0,
    clock_drift=1e-7,
    base_share=1.0,
    tracking=Tracking(slips_per_hour=0.0, outages_per_hour=20.0),
)


@pytest.mark.slow
def test_satellites_that_the_base_regains_do_not_cost_the_fix(tmp_path):
    """Oracle: the exact motion. By default all is fixed within 10 cm; RTKLIB's interpolation of the
    base loses half of this flight.
    """
    if find_spec("pyrtklib5") is None:
        pytest.skip("pyrtklib5 is not installed")
    flight = write_dataset(
        tmp_path / "f", "ign8", 2.0, imu_rate=100.0, start_in_air=True, seed=4, raw_gnss=RECEIVERS
    )
    raw, place = flight.simulated.raw_gnss, tmp_path / "f/01_Observations/GPS/Data"
    rover, gps, glonass = (next((place / "Rover").glob(f"*{ending}")) for ending in "ong")
    fixed, off = {}, {}
    for name, more in (("ours", {}), ("interpolated", {"misc-timeinterp": "1"})):
        options = EngineOptions(
            base_position_m=tuple(raw.base_position_m), base_point="apc", rtklib_options=more
        )
        run = solve(
            rover, next((place / "Master").iterdir()), [gps, glonass], options, tmp_path / name
        )
        fixes = read_rtklib_pos(run.combined)
        row = np.searchsorted(raw.rover.time, fixes.time - 1e-3)
        at = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height) - raw.rover.position[row]
        fixed[name] = fixes.quality == 1
        off[name] = np.linalg.norm(at, axis=1)[fixed[name]].max()
    assert fixed["ours"].all()
    assert off["ours"] < 0.1
    assert fixed["interpolated"].mean() < 0.75
