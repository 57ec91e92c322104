"""Magnetic field in body axes: it gives heading without motion.

The field at a place is that of a dipole along the Earth's axis, of which strength and dip are
states since the true field differs from it, and the declination that is stated. With C the attitude
and the sensor's soft iron M (scale, cross axes and rotation against the body) and hard iron h

    z = (I + M) C_bn B(strength, dip, declination) + h
"""

import numpy as np

from ...base.units import DEG
from ...io.formats.names import TIME, Names, sigma_names, spelled
from ...io.formats.text.columns import TableSpec
from ...navigation.prepare.axes import parse_axes
from ...records import Array
from ...records.measurements import Motion, OwnState, Predict
from .kinds import Kind
from .options import MeasurementInput

EQUATOR_UT = 29.8  # of the dipole, on the equator (IGRF 2020)
# of the true field against the dipole's: of the world's land a third differs by more than 10 deg
# and 15 %, South America and southern Africa by up to 40 deg and 40 %
DIP_SIGMA, STRENGTH_SIGMA = 15.0 * DEG, 0.2
STEMS = "mag m b magnetic magnetic_field magnetometer field"
AXES = ("forward", "right", "down")
NAMES: Names = {
    **TIME,
    **{axis: f"{axis} {spelled(STEMS, axis)}" for axis in "xyz"},
    **{f"sigma_{axis}": sigma_names(f"{axis} mag_{axis} m_{axis}") for axis in "xyz"},
}


def _model(
    options: MeasurementInput, columns: tuple[str, ...]
) -> tuple[Predict, tuple[OwnState, ...]]:
    """Return the field in the axes of the sensor, and its states; iron of no sigma is none."""
    hard = 3 if options.hard_iron_sigma else 0
    soft = 9 if options.soft_iron_sigma else 0
    to_body = parse_axes(options.axes)
    declination = (options.declination_deg or 0.0) * DEG

    def predict(motion: Motion, states: Array) -> Array:
        latitude = motion.geodetic[0]
        strength, dip, turn = states[:, hard + soft :].T
        total = EQUATOR_UT * (1.0 + strength) * np.sqrt(1.0 + 3.0 * np.sin(latitude) ** 2)
        dip = dip + np.arctan2(2.0 * np.sin(latitude), np.cos(latitude))
        level, azimuth = total * np.cos(dip), declination + turn
        field = np.column_stack(
            [level * np.cos(azimuth), level * np.sin(azimuth), total * np.sin(dip)]
        )
        values = np.einsum("kji,kj->ki", motion.C_nb, field)
        if soft:
            iron = states[:, hard : hard + soft].reshape(-1, 3, 3)
            values = values + np.einsum("kij,kj->ki", iron, values)
        return (values + states[:, :hard] if hard else values) @ to_body

    irons = [OwnState(f"hard iron {axis}", options.hard_iron_sigma, "uT") for axis in AXES[:hard]]
    if soft:
        sigma = options.soft_iron_sigma
        irons += [OwnState(f"soft iron {a} of {b}", sigma) for a in AXES for b in AXES]
    field = (
        OwnState("strength of the field", STRENGTH_SIGMA),
        OwnState("dip of the field", DIP_SIGMA, "rad"),
        OwnState("declination", options.declination_sigma_deg * DEG, "rad"),
    )
    return predict, (*irons, *field)


KIND = Kind(
    TableSpec(
        NAMES,
        required="tow x y z",
        layouts=("tow x y z", "tow x y z sigma_x sigma_y sigma_z"),
        units={"field": "x y z sigma_x sigma_y sigma_z", "time": "tow"},
        record="measurement",
    ),
    "x y z",
    "field",
    _model,
    reads=(
        *("axes", "declination_deg", "declination_sigma_deg"),
        *("hard_iron_sigma", "soft_iron_sigma"),
    ),
    needs=("declination_deg",),
)
