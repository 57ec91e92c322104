"""What readers of poses share: a caller's hints beyond the file, and covariances in other axes."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.units import LARGEST_UNIT
from ...geodesy.crs import crs_of
from ...geodesy.datums import sibling_code
from ...geodesy.frames import TangentPlane
from ...geodesy.projection import MapProjection
from ...records import Array
from ...records.framed import GEOCENTRIC, GEOGRAPHIC, PROJECTED

Origin = tuple[float, float, float]
CODE = re.compile(r"EPSG:\d+(?:\+\d+)?")  # of a CRS, of a compound one as well


@dataclass(frozen=True)
class Hints:
    """What a caller knows beyond the file: origin of a tangent plane, deg, deg, m.

    CRS of coordinates; GPS week; geoid grid.

    Parameters
    ----------
    shift : what was subtracted from the coordinates, in the unit of the CRS.
    undulation_m : of the geoid, to be added to heights of positions of GNSS.
    datum, epoch : of the positions from which a projected CRS was reached; None: WGS 84.
    """

    origin: Origin | None = None
    crs: str | None = None
    gps_week: int | None = None
    geoid: Path | None = None
    undulation_m: float | None = None
    datum: str | None = None
    epoch: float | None = None
    shift: Origin | None = None

    @property
    def plane(self) -> TangentPlane | None:
        """The tangent plane, if an origin is given."""
        return (
            None
            if self.origin is None
            else TangentPlane(
                np.radians(self.origin[0]), np.radians(self.origin[1]), self.origin[2]
            )
        )

    @property
    def projection(self) -> MapProjection | None:
        """The projection, if a CRS is given."""
        return None if self.crs is None else self.projected(self.crs)

    def projection_in(self, header: str) -> MapProjection | None:
        """Return the projection, else that of the CRS whose code a header names."""
        code = CODE.search(header)
        return self.projection or (None if code is None else self.projected(code[0]))

    def projected(self, code: str) -> MapProjection:
        """Return the projection of a CRS that a file names."""
        return MapProjection(code, self.geoid, self.datum, self.epoch, any_unit=True)


def globe_of(text: str) -> tuple[str, str | None, float | None]:
    """Kind, datum and epoch of the geographic or geocentric CRS whose code stands in a text.

    The kind of any other CRS is "projected", without a code it is empty. WGS 84 is the datum None.

    Raises
    ------
    UsageError
        A code that PROJ does not know.
    """
    code = CODE.search(text)
    if code is None:
        return "", None, None
    crs = crs_of(code[0])
    if crs.is_compound or not (crs.is_geographic or crs.is_geocentric):
        return PROJECTED, None, None
    kind = GEOCENTRIC if crs.is_geocentric else GEOGRAPHIC
    if crs.name == "WGS 84":
        return kind, None, None
    epoch = re.search(r"\bepoch (\d+(?:\.\d+)?)", text)
    datum = code[0] if kind == GEOGRAPHIC else sibling_code(crs, "GEOGRAPHIC_3D_CRS")
    return kind, datum or None, None if epoch is None else float(epoch[1])


def diagonal(path: Path, sigma: Array | None, E: Array | None = None) -> Array | None:
    """(n, 3, 3) of standard deviations (n, 3).

    Of angles, whose psi is E d(angles); None where there are none, or where all are zero.

    Raises
    ------
    InputError
        One that is negative, too large, or zero beside others.
    """
    if sigma is None or not sigma.any():
        return None
    if (wrong := ~((sigma > 0.0) & (sigma <= LARGEST_UNIT))).any():
        row = int(np.argmax(wrong.any(axis=1)))
        value = sigma[row][wrong[row]][0]
        problem = f"pose {row + 1}: a standard deviation of {value:g}, others are positive"
        raise InputError.in_file(path, f"{problem}; correct it or leave these columns out")
    P = np.zeros((len(sigma), 3, 3))
    P[:, range(3), range(3)] = sigma**2
    return P if E is None else np.asarray(E @ P @ np.swapaxes(E, 1, 2))


def rotate_covariance(C: Array, P: Array | None) -> Array | None:
    """C P C^T."""
    return None if P is None else np.asarray(C @ P @ np.swapaxes(C, -1, -2))
