"""Roll, pitch and heading of another system: an adjustment, a star tracker, a total station."""

from ...geodesy.rotation import rotation_from_vector, rpy_from_rotation
from ...io.formats.names import TIME, Names, sigma_names
from ...io.formats.text.columns import TableSpec
from ...records import Array
from ...records.measurements import Motion, OwnState, Predict
from .kinds import Kind, turned_angles
from .options import MeasurementInput

NAMES: Names = {
    **TIME,
    "roll": "roll",
    "pitch": "pitch",
    "heading": "heading yaw hdg",
    "sigma_roll": sigma_names("roll"),
    "sigma_pitch": sigma_names("pitch"),
    "sigma_heading": sigma_names("heading yaw hdg"),
}


def _model(
    options: MeasurementInput, columns: tuple[str, ...]
) -> tuple[Predict, tuple[OwnState, ...]]:
    """Return the angles of a sensor that is turned against the body by a constant rotation."""

    def predict(motion: Motion, states: Array) -> Array:
        return rpy_from_rotation(motion.C_nb @ rotation_from_vector(states))

    return predict, turned_angles(options, "forward", "right", "down")


KIND = Kind(
    TableSpec(
        NAMES,
        required="tow roll pitch heading",
        layouts=(
            "tow roll pitch heading",
            "tow roll pitch heading sigma_roll sigma_pitch sigma_heading",
        ),
        units={
            "angle": "roll pitch heading sigma_roll sigma_pitch sigma_heading",
            "time": "tow",
        },
        record="measurement",
    ),
    "roll pitch heading",
    "angle",
    _model,
)
