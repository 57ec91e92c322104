"""Headings of the body, as two antennas on one receiver or a gyrocompass give them."""

from pathlib import Path

from ...io.formats.detect import head_of, is_nmea
from ...io.formats.gnss.nmea import read_headings
from ...io.formats.gnss.oem_headings import is_oem_log, read_oem_headings
from ...io.formats.names import TIME, Names
from ...io.formats.text.columns import TableSpec
from ...records import Array
from ...records.measurements import Motion, OwnState, Predict
from .kinds import Kind, LogRows, turned_angles
from .options import MeasurementInput

NAMES: Names = {
    **TIME,
    "heading": "heading hdg yaw azimuth true_heading hdt",
    "sigma_heading": "sigma_heading sd_heading heading_sd heading_std heading_stddev sigma sd std",
}


def _model(
    options: MeasurementInput, columns: tuple[str, ...]
) -> tuple[Predict, tuple[OwnState, ...]]:
    """Return heading of the body plus the constant angle by which the sensor is turned."""

    def predict(motion: Motion, states: Array) -> Array:
        return motion.roll_pitch_heading[:, 2] + states.sum(axis=1)

    return predict, turned_angles(options, "")


def _of_receiver(path: Path) -> LogRows | None:
    """Return the headings of a receiver's log, None where the file is a table."""
    head = head_of(path)
    if is_oem_log(head):
        return read_oem_headings(path)
    return (*read_headings(path), None, ()) if is_nmea(head) else None


KIND = Kind(
    TableSpec(
        NAMES,
        required="tow heading",
        layouts=("tow heading", "tow heading sigma_heading"),
        units={"angle": "heading sigma_heading", "time": "tow"},
        record="measurement",
    ),
    "heading",
    "angle",
    _model,
    other_format=_of_receiver,
)
