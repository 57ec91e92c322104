"""Table [gnss] of the flight file: the positions of the antenna, how they are read and weighted.

Raw observations in their place, and how they are solved, stand in `ppk_options`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ...base.errors import InputError
from ...gnss.covariance_model import MODEL, CovarianceModel
from ...gnss.ppk_options import RawGnss
from ...io.options.kinds import Checked
from ...io.options.schema import Triple, columns_of_file, option, sigmas, take_record
from ...navigation.prepare.fix_covariance.numbers import QUALITY_SIGMA_M

if TYPE_CHECKING:
    from ...base.tables import Columns
    from ...records import GnssFixes

QUALITIES = ("fixed", "float", "sbas", "dgps", "single", "ppp")
"""Names, in small letters, of the qualities (`records.qualities.Quality`) that have floors."""


def _unit_keys() -> tuple[str, ...]:
    from ...io.formats.gnss.gnss_text import SPEC

    return (*SPEC.units, "quality")


@dataclass(frozen=True)
class GnssInput(Checked, table="gnss"):
    """Table [gnss]; standard deviations are north, east, down; `raw` instead of a file for PPK.

    In Python `file` may be fixes, or an array or table of them, which takes sigma_m where it has
    none; what else says how to read a file is then not looked at, and `Flight.with_` refuses it.

    Raises
    ------
    OptionError
        For a value that cannot be.
    InputError
        Where `file` is neither a path nor fixes, or something else stands in its place as well.
    """

    file: "Path | GnssFixes | None" = option(
        ...,
        "file of antenna positions; or gnss.stationary, or gnss.rover, base and navigation",
        kind="file",
    )
    stationary: Triple | None = option(
        None,
        "position of a sensor at rest throughout the recording, in place of gnss.file, used as "
        "one fix a second; gnss.sigma_m is 0.1 by default",
        kind="place",
    )
    columns: "Columns" = columns_of_file(
        'columns of the file: list of names, or table { canonical = "name in the file" }',
        of_file=True,
    )
    units: Mapping[str, str] | None = option(
        None,
        "units of angle (latitude, longitude) and course: deg, rad; length (heights) and sigma "
        "(standard deviations of positions): m, cm, mm; velocity: m/s, cm/s, mm/s, km/h, kn; "
        "time: as in imu.units; codes of the column `q` (quality): rtklib, nmea",
        kind="gnss_units",
        members=_unit_keys,
        usual="by header, else SI and deg",
        of_file=True,
    )
    undulation_m: float | None = option(
        None,
        "height of the geoid above the ellipsoid, needed if the file has heights above the geoid",
        unit="m",
        low=-200.0,
        high=200.0,
        of_file=True,
    )
    deflection_arcsec: tuple[float, float] = option(
        (0.0, 0.0),
        "deflection of the vertical at the flight from a geoid model or survey, xi north and eta "
        "east (zenith of the plumb line against the ellipsoidal normal); gravity is turned by it",
        unit="arcsec",
        low=-120.0,
        high=120.0,
    )
    # without a stated value what plains have: maps of the deflection reach 10 arcsec there, 20 to
    # 50 in high mountains
    deflection_sigma_arcsec: float = option(
        5.0,
        "standard deviation of each component of the deflection of the vertical, included in all "
        "attitude covariances: 1 to 2 for a geoid model, 20 for mountains without; 0: exact",
        unit="arcsec",
        low=0.0,
        high=120.0,
    )
    sigma_m: Triple | None = sigmas(
        "standard deviations of the positions north, east, down, used if the file has none",
        of_file=True,
    )
    sigma_velocity_mps: Triple | None = sigmas("the same of velocities", unit="m/s", of_file=True)
    time_offset_s: float = option(
        0.0,
        "time offset added to the time stamps of the fixes; from half a second on, if the fixes "
        "count GPST, the IMU's stamps are moved instead, so that products count GPST",
        unit="s",
    )
    time_sigma_s: float = option(
        1e-3,
        "standard deviation of the time offset between fixes and IMU, a state that all "
        "covariances include (default: unknown; IMU on the receiver's PPS: 2e-4); 0: exact",
        unit="s",
        low=0.0,
        high=1.0,
    )
    datum: str | None = option(
        None,
        "geographic CRS of the positions, the same as of the base's coordinates: EPSG:4937 "
        "(ETRS89), EPSG:9989 (ITRF2020), ...; exports into output.crs are transformed from it",
        usual="WGS 84",
    )
    epoch: float | None = option(
        None,
        "epoch of the positions, decimal year, needed if gnss.datum is dynamic (ITRF)",
        low=1980.0,
        high=2100.0,
    )
    reference: Triple | None = option(
        None,
        "origin of the positions, needed if the file has north, east and down or up",
        kind="place",
        usual="a comment of the file",
        of_file=True,
    )
    moved_base: tuple[Triple, Triple] | None = option(
        None,
        "old and new position of the base station; all positions are moved by the difference",
        kind="moved",
        form="[old, new], each [latitude deg, longitude deg, ellipsoidal height m]",
        of_file=True,
    )
    variable: str | None = option(None, "struct or table inside a MATLAB file", of_file=True)
    repeat_column: str | None = option(
        None,
        "column whose change marks a new fix, for a file that repeats the last fix",
        of_file=True,
    )
    gate_sigma: float = option(
        5.0,
        "innovation gate: fixes whose innovation exceeds this many standard deviations are "
        "rejected and counted",
        low=2.0,
        high=30.0,
    )
    quality_sigma_m: Mapping[str, Triple] = option(
        lambda: dict(QUALITY_SIGMA_M),
        "least standard deviations north, east, down of fixes of each quality, to which smaller "
        "ones of the file are raised (needs a column of quality); none by default with "
        "gnss.rover, where gnss.covariance sets them",
        kind="quality_sigmas",
        unit="m",
        members=lambda: QUALITIES,
        usual="float, sbas, dgps [0.3, 0.3, 0.6], single [1, 1, 2]",
    )
    calibrate_covariance: bool = option(
        True,
        "calibrate the covariances of an RTKLIB `.pos` with quality, satellites and base (`ref "
        "pos` in its header) as with PPK: fixed epochs that no other epochs confirm are taken as "
        "float, and covariances are enlarged to cover their errors; false: as in the file",
        of_file=True,
    )
    gm_sigma: float | Literal["auto", "off"] = option(
        "auto",
        "time-correlated (Gauss-Markov) error, as a multiple of the standard deviation of each "
        "fix; auto: estimated if the innovations show it, and assumed for float and code "
        "solutions (over one and ten minutes)",
        kind="gm_sigma",
        low=1e-2,
        high=100.0,
        choices=("auto", "off"),
    )
    correlation_time_s: float = option(
        60.0, "correlation time of this error", unit="s", low=0.1, high=1e5
    )
    white_scale: float = option(
        1.0, "white error, in standard deviations of each fix", low=1e-2, high=100.0
    )
    covariance: CovarianceModel = option(
        lambda: MODEL,
        "changes to the factors and floors that calibrate the covariances of PPK, or of a `.pos` "
        "with gnss.calibrate_covariance; needs quality, satellites and base in the file",
        kind="covariance",
        form="table, below",
        usual="as measured",
        cli="--covariance",
        metavar="FILE",
        cli_meaning=(
            "TOML file of changes to the covariance model, with the keys of gnss.covariance at "
            "the top (data_specs/flight_file.md)"
        ),
        of_file=True,
    )
    raw: RawGnss | None = None

    def __post_init__(self) -> None:
        """Refuse options that contradict each other."""
        super().__post_init__()
        of_array = (self.sigma_m, self.sigma_velocity_mps)  # a record has its own
        sigmas = () if hasattr(self.file, "cov_ned") else of_array
        take_record(self, "file", "gnss_fixes", *sigmas)
        if self.file is None or isinstance(self.file, Path):
            return
        stated = (name for name in ("raw", "stationary") if getattr(self, name) is not None)
        if second := next(stated, ""):
            conflict = f"gnss.{second} as well; set gnss__{second}=None"
            raise InputError(f"gnss.file is given as an object, and {conflict}")
