"""What a comparison may be given of its files: options of `insgnss compare` and of its function.

Standard library only, for the command line.
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from .kinds import Checked
from .schema import argument

GEOID = "geoid above the ellipsoid, to be added to heights of"
OF_GNSS = ", positions of GNSS that are above the geoid"
_form = partial(argument, metavar="FORMAT")
_undulation = partial(argument, metavar="M")


@dataclass(frozen=True)
class ComparisonOptions(Checked):
    """What two files of poses do not say.

    Parameters
    ----------
    form_a, form_b : str or None
        Formats of files that do not show it.
    undulation_a_m, undulation_b_m : float or None
        Geoid above the ellipsoid, to be added to heights of positions of GNSS.
    origin : tuple of float or None
        Latitude, longitude, deg, and ellipsoidal height, m, of a tangent plane whose file does not
        give it; without it that of the other file is taken, and noted.
    crs : str or None
        Of coordinates whose file does not name it.
    coordinate_shift : tuple of float or None
        What was subtracted from projected coordinates, in their unit.
    geoid : Path or None
        For projected heights above sea level.
    gps_week : int or None
        Of files with the time of week only.
    time_shift_s : float
        To be added to the times of b.
    """

    form_a: str | None = _form(
        None,
        "format of A, if not recognised from the file; one of the formats above",
        cli="--format-a",
    )
    form_b: str | None = _form(
        None,
        "format of B, if not recognised from the file; one of the formats above",
        cli="--format-b",
    )
    undulation_a_m: float | None = _undulation(None, f"{GEOID} A{OF_GNSS}", cli="--undulation-a")
    undulation_b_m: float | None = _undulation(None, f"{GEOID} B{OF_GNSS}", cli="--undulation-b")
    origin: tuple[float, float, float] | None = argument(
        None,
        "origin of the tangent plane (deg, deg, m), if the file does not give it",
        kind="place",
        metavar="LAT,LON,H",
    )
    crs: str | None = argument(
        None,
        "CRS of the coordinates, if the file does not name it, such as EPSG:2056",
        metavar="CRS",
    )
    coordinate_shift: tuple[float, float, float] | None = argument(
        None,
        "shift that was subtracted from projected coordinates, in their unit",
        kind="pair",
        metavar="E,N,H",
    )
    geoid: Path | None = argument(
        None, "grid of geoid heights, for projected heights above sea level", metavar="GRID"
    )
    gps_week: int | None = argument(
        None, "GPS week, for files that give the time of week only", cli="--week"
    )
    time_shift_s: float = argument(
        0.0, "seconds to be added to the times of B", cli="--shift", metavar="S"
    )
