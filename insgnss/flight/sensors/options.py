"""Table [[measurement]] of the flight file: a sensor whose values are predicted from the motion."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ...base.received.plugins import installed
from ...io.options.kinds import check
from ...io.options.schema import Triple, columns_of_file, option

if TYPE_CHECKING:
    from ...base.tables import Columns

ENTRY_POINTS = "insgnss.measurements"
"""Entry points by which an installed package adds kinds."""
SHIPPED = (
    "heading",
    "attitude",
    "body_velocity",
    "baseline",
    "magnetometer",
    "airspeed",
    "position",
)


def _kinds() -> tuple[str, ...]:
    return (*SHIPPED, *installed(ENTRY_POINTS))


def _unit_keys() -> tuple[str, ...]:
    return ("angle", "velocity", "length", "field", "time")


@dataclass(frozen=True)
class MeasurementInput:
    """Table [[measurement]]; each is one sensor.

    Raises
    ------
    OptionError
        For a value that cannot be.
    """

    kind: str = option(
        ...,
        "what the sensor measures (measurement.md): heading, attitude, body velocity, a baseline"
        " from one antenna to another, the magnetic field, the speed through the air or a position"
        " from a total station; or a kind that an installed plugin adds",
        kind="choice",
        choices=_kinds,
    )
    file: Path = option(..., "table of times, values and standard deviations", kind="file")
    name: str | None = option(
        None,
        "name of the sensor in the report; every sensor needs its own",
        form="text",
        usual="the kind",
    )
    columns: "Columns" = columns_of_file("as gnss.columns", of_file=True)
    units: Mapping[str, str] | None = option(
        None,
        "angle: deg, rad; velocity: m/s, cm/s, mm/s, km/h, kn; length: m, cm, mm;"
        " field: uT, nT, mG, G; time as imu.units",
        kind="gnss_units",
        members=_unit_keys,
        usual="by header, else deg, m/s, m, uT and s",
        of_file=True,
    )
    time_offset_s: float = option(0.0, "added to the stamps of this sensor", unit="s")
    sigma: float | None = option(
        None,
        "standard deviation of the values where the file has none, in deg, m/s, m or uT",
        usual="that of the file",
        low=1e-6,
        high=1e3,
    )
    gate_sigma: float = option(
        5.0,
        "values further from their prediction, in standard deviations, are left out",
        low=2.0,
        high=100.0,
    )
    offset_sigma_deg: float = option(
        2.0,
        "a-priori standard deviation of each angle by which the sensor is turned against the body,"
        " which are estimated; 0: 0.05 deg",
        unit="deg",
        low=0.0,
        high=180.0,
    )
    scale_sigma: float = option(
        0.02,
        "of body_velocity and airspeed: a-priori standard deviation of the scale factor, a state;"
        " 0: 1e-4",
        low=0.0,
        high=0.5,
    )
    axes: str = option(
        "forward right down",
        "of magnetometer: body directions of its x, y and z, as imu.axes",
        kind="axes",
    )
    declination_deg: float | None = option(
        None,
        "of magnetometer: azimuth of magnetic north at place and date of the flight, as a model of"
        " the field gives it (WMM, IGRF)",
        unit="deg",
        low=-180.0,
        high=180.0,
    )
    declination_sigma_deg: float = option(
        0.5,
        "of magnetometer: a-priori standard deviation of the declination, a state",
        unit="deg",
        low=0.01,
        high=180.0,
    )
    hard_iron_sigma: float = option(
        2.0,
        "of magnetometer: a-priori standard deviation, uT, of each axis of the vehicle's own"
        " constant field, which are estimated; without calibration 50; 0: none",
        low=0.0,
        high=1e3,
    )
    soft_iron_sigma: float = option(
        0.02,
        "of magnetometer: a-priori standard deviation of the nine scale, cross-axis and alignment"
        " factors, which are estimated; 0: none",
        low=0.0,
        high=0.5,
    )
    lever_m: Triple = option(
        (0.0, 0.0, 0.0),
        "in body axes: of body_velocity and position from the IMU to where it is measured (the"
        " prism); of baseline from the first antenna to the second",
        unit="m",
    )
    station: Triple | None = option(
        None,
        "of position: latitude and longitude, deg, and ellipsoidal height, m, of the point that its"
        " values count from",
    )
    station_sigma_m: float = option(
        0.02,
        "of position: a-priori standard deviation of each coordinate of the station, which are"
        " states; 0: none",
        unit="m",
        low=0.0,
        high=1e3,
    )
    clock_sigma_s: float = option(
        0.0,
        "of position: a-priori standard deviation of the time by which its stamps are early, a"
        " state; 0: none",
        unit="s",
        low=0.0,
        high=10.0,
    )

    def __post_init__(self) -> None:
        check(self, "measurement")

    @property
    def called(self) -> str:
        """Its name, or that of its kind."""
        return self.name or self.kind
