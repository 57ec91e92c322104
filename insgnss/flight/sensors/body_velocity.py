"""Velocities in body axes: an odometer (forward alone), a Doppler log, an optical flow sensor."""

import numpy as np

from ...geodesy.rotation import rotation_from_vector
from ...io.formats.names import TIME, Names, sigma_names
from ...io.formats.text.columns import TableSpec
from ...records import Array
from ...records.measurements import Motion, OwnState, Predict
from .kinds import EXACT_SCALE, Kind, turned_angles
from .options import MeasurementInput

NAMES: Names = {
    **TIME,
    "forward": "forward v_forward forward_speed speed vx v_x odometer wheel_speed",
    "right": "right v_right vy v_y",
    "down": "down v_down vz v_z",
    "sigma_forward": sigma_names("forward v_forward speed vx v_x"),
    "sigma_right": sigma_names("right v_right vy v_y"),
    "sigma_down": sigma_names("down v_down vz v_z"),
}
AXES = ("forward", "right", "down")


def _model(
    options: MeasurementInput, columns: tuple[str, ...]
) -> tuple[Predict, tuple[OwnState, ...]]:
    """Return (1 + s) R' (v + omega x l) with scale factor s and rotation R of the sensor."""
    rows = [AXES.index(name) for name in columns]
    lever = np.array(options.lever_m)
    # an angle about the axis of the one component that is measured does nothing
    angles = [axis for axis in AXES if columns != (axis,)]
    about = [AXES.index(axis) for axis in angles]

    def predict(motion: Motion, states: Array) -> Array:
        offsets = np.zeros((motion.time.size, 3))
        offsets[:, about] = states[:, 1:]
        velocity = motion.velocity_body + np.cross(motion.rate, lever)
        velocity = np.einsum("kji,kj->ki", rotation_from_vector(offsets), velocity)
        return (1.0 + states[:, :1]) * velocity[:, rows]

    scale = OwnState("scale factor", max(options.scale_sigma, EXACT_SCALE))
    return predict, (scale, *turned_angles(options, *angles))


KIND = Kind(
    TableSpec(
        NAMES,
        required="tow",
        layouts=(
            "tow forward",
            "tow forward sigma_forward",
            "tow forward right down",
            "tow forward right down sigma_forward sigma_right sigma_down",
        ),
        units={
            "velocity": "forward right down sigma_forward sigma_right sigma_down",
            "time": "tow",
        },
        record="measurement",
    ),
    "forward right down",
    "velocity",
    _model,
    reads=("offset_sigma_deg", "scale_sigma", "lever_m"),
)
