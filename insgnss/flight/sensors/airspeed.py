"""Speed through the air along the body's forward axis, as a pitot tube has it: wind is a state."""

import numpy as np

from ...io.formats.names import TIME, Names, sigma_names
from ...io.formats.text.columns import TableSpec
from ...records import Array
from ...records.measurements import Motion, OwnState, Predict
from .kinds import EXACT_SCALE, Kind
from .options import MeasurementInput

NAMES: Names = {
    **TIME,
    "airspeed": "airspeed air_speed tas true_airspeed true_airspeed_m_s airspeed_true",
    "sigma_airspeed": sigma_names("airspeed air_speed tas true_airspeed"),
}
WIND_SIGMA = 10.0  # m/s, north and east: a mapping drone does not take off in more
# m/s/sqrt(s): gusts and the change with height and place make 1.5 m/s within a minute
WIND_WALK = 0.2


def _model(
    options: MeasurementInput, columns: tuple[str, ...]
) -> tuple[Predict, tuple[OwnState, ...]]:
    """Return (1 + s) of the forward component of velocity less level wind."""

    def predict(motion: Motion, states: Array) -> Array:
        wind = np.pad(states[:, 1:], ((0, 0), (0, 1)))
        forward = motion.C_nb[:, :, 0]
        through_air = np.einsum("ki,ki->k", forward, motion.velocity_ned - wind)
        return (1.0 + states[:, 0]) * through_air

    scale = OwnState("scale factor", max(options.scale_sigma, EXACT_SCALE))
    winds = (OwnState(f"wind {axis}", WIND_SIGMA, "m/s", WIND_WALK) for axis in ("north", "east"))
    return predict, (scale, *winds)


KIND = Kind(
    TableSpec(
        NAMES,
        required="tow airspeed",
        layouts=("tow airspeed", "tow airspeed sigma_airspeed"),
        units={"velocity": "airspeed sigma_airspeed", "time": "tow"},
        record="measurement",
    ),
    "airspeed",
    "velocity",
    _model,
    reads=("scale_sigma",),
)
