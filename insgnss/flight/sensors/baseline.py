"""Vectors from one antenna on the body to another, north, east and down: a moving-base solution."""

import numpy as np

from ...geodesy.rotation import rotation_from_vector
from ...io.formats.names import TIME, Names, sigma_names
from ...io.formats.text.columns import TableSpec
from ...records import Array
from ...records.measurements import Motion, OwnState, Predict
from .kinds import Kind, turned_angles
from .options import MeasurementInput

NAMES: Names = {
    **TIME,
    "n": "n north relposn rel_n rel_pos_n baseline_n dn",
    "e": "e east relpose rel_e rel_pos_e baseline_e de",
    "d": "d down relposd rel_d rel_pos_d baseline_d dd",
    "sigma_n": f"{sigma_names('n north')} accn",
    "sigma_e": f"{sigma_names('e east')} acce",
    "sigma_d": f"{sigma_names('d down')} accd",
}


def _model(
    options: MeasurementInput, columns: tuple[str, ...]
) -> tuple[Predict, tuple[OwnState, ...]]:
    """Return the vector between the antennas, turned by angles that are states."""
    lever = np.array(options.lever_m)

    def predict(motion: Motion, states: Array) -> Array:
        return np.einsum("kij,kj->ki", motion.C_nb, rotation_from_vector(states) @ lever)

    return predict, turned_angles(options, "forward", "right", "down")


KIND = Kind(
    TableSpec(
        NAMES,
        required="tow n e d",
        layouts=("tow n e d", "tow n e d sigma_n sigma_e sigma_d"),
        units={"length": "n e d sigma_n sigma_e sigma_d", "time": "tow"},
        record="measurement",
    ),
    "n e d",
    "length",
    _model,
    reads=("offset_sigma_deg", "lever_m"),
    needs=("lever_m",),
)
