"""Camera positions without angles: for Metashape, PIX4D, ODM, RealityCapture, tables and maps.

The columns are those of the files with angles (data_specs/metashape.md, pix4d.md, odm.md,
realitycapture.md) without them; the program then takes none. Each writer is a pure function of
names, coordinates and standard deviations, in degrees (longitude, latitude) or metres (easting,
northing).
"""

import json
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ....base.errors import UsageError
from ....base.files import atomic_write
from ....records import Array
from ..orientation.exported import check_names, table_text
from ..text.text import Source


@dataclass(frozen=True, eq=False)
class PlacedCameras:
    """Camera positions in the coordinates of one reference system.

    Parameters
    ----------
    images : tuple of str
        Names.
    coordinates : ndarray, shape (n, 3)
        Longitude, latitude in degrees, or easting, northing in m; height in m.
    sigma : ndarray, shape (n, 3)
        Standard deviations east, north, up, m.
    crs : str
        Name or code of a projected reference system; empty for geographic coordinates of WGS84.
    heights : str
        What heights are above.
    northing_first : bool
        Whether the reference system itself has northing, or latitude, first.
    wkt : str
        Well-known text of a projected reference system.
    """

    images: tuple[str, ...]
    coordinates: Array
    sigma: Array
    crs: str
    heights: str
    northing_first: bool
    wkt: str = ""

    @property
    def digits(self) -> str:
        """The % format of a horizontal coordinate."""
        return "%.4f" if self.crs else "%.10f"

    @property
    def plan_and_height(self) -> Array:
        """(n, 2) standard deviations, horizontal as root mean square of both, and vertical, m."""
        plan = np.sqrt(0.5 * (self.sigma[:, 0] ** 2 + self.sigma[:, 1] ** 2))
        return np.column_stack([plan, self.sigma[:, 2]])


def write_metashape_positions(cameras: PlacedCameras, path: Source) -> None:
    """Write Metashape's reference csv without angles; import with columns "nxyXYZ" in its order.

    Raises
    ------
    InputError
        Names with commas.
    """
    check_names(cameras.images, ",")
    name = cameras.crs.replace(",", ";")
    first = (f"Easting ({name}; heights {cameras.heights})", "Northing", "Height")
    head = ("#Label", *(first if cameras.crs else "XYZ"), "X_acc", "Y_acc", "Z_acc")
    form = f"%s,{cameras.digits},{cameras.digits},%.4f" + ",%.5f" * 3 + "\n"
    table = np.hstack([cameras.coordinates, cameras.sigma])
    atomic_write(path, table_text(",".join(head) + "\n", cameras.images, form, table))


def write_pix4d_positions(cameras: PlacedCameras, path: Source) -> None:
    """Write PIX4D's geolocation file: image, coordinates in the system's own order, accuracies.

    Raises
    ------
    InputError
        Names with commas.
    """
    check_names(cameras.images, ",")
    order = [1, 0, 2] if cameras.northing_first else [0, 1, 2]
    form = f"%s,{cameras.digits},{cameras.digits},%.4f" + ",%.5f" * 2 + "\n"
    table = np.hstack([cameras.coordinates[:, order], cameras.plan_and_height])
    atomic_write(path, table_text("", cameras.images, form, table))


def write_odm_positions(cameras: PlacedCameras, path: Source) -> None:
    """Write OpenDroneMap's geo.txt without angles.

    Raises
    ------
    UsageError
        A reference system without EPSG code.
    InputError
        Names with blanks.
    """
    check_names(cameras.images, None)
    code = cameras.crs or "EPSG:4326"
    if not code.startswith("EPSG:"):
        raise UsageError(
            f"odm: {code} has no EPSG code, which the first line of geo.txt needs; export a CRS"
            " that has, or geographic"
        )
    form = f"%s {cameras.digits} {cameras.digits} %.4f NaN NaN NaN %.5f %.5f\n"
    table = np.hstack([cameras.coordinates, cameras.plan_and_height])
    atomic_write(path, table_text(f"{code.split()[0]}\n", cameras.images, form, table))


def write_realitycapture_positions(cameras: PlacedCameras, path: Source) -> None:
    """Write a flight log of RealityCapture without angles, with accuracies.

    Raises
    ------
    InputError
        Names with commas.
    """
    check_names(cameras.images, ",")
    order = [0, 1, 2] if cameras.crs else [1, 0, 2]
    first = "x,y" if cameras.crs else "latitude,longitude"
    form = f"%s,{cameras.digits},{cameras.digits},%.4f" + ",%.5f" * 3 + "\n"
    table = np.hstack([cameras.coordinates[:, order], cameras.sigma])
    head = f"#name,{first},altitude,accX,accY,accZ\n"
    atomic_write(path, table_text(head, cameras.images, form, table))


def write_table_of_positions(cameras: PlacedCameras, path: Source) -> None:
    """Write a table with a header: image, coordinates, standard deviations east, north, up, m.

    Raises
    ------
    InputError
        Names with commas.
    """
    check_names(cameras.images, ",")
    first = "easting_m,northing_m" if cameras.crs else "longitude_deg,latitude_deg"
    head = f"# {cameras.crs or 'geographic coordinates of WGS84'}; heights {cameras.heights}\n"
    head += f"image,{first},height_m,sigma_east_m,sigma_north_m,sigma_up_m\n"
    form = f"%s,{cameras.digits},{cameras.digits},%.4f" + ",%.5f" * 3 + "\n"
    table = np.hstack([cameras.coordinates, cameras.sigma])
    atomic_write(path, table_text(head, cameras.images, form, table))


def write_geojson_positions(cameras: PlacedCameras, path: Source) -> None:
    """Write GeoJSON: a point an image, with its standard deviations east, north, up, m.

    Raises
    ------
    UsageError
        Projected coordinates and heights above a geoid, which the format does not know.
    """
    if cameras.crs or "ellipsoid" not in cameras.heights:
        raise UsageError(
            "geojson: takes longitude, latitude and heights above the ellipsoid of WGS84; leave"
            " --crs and --geoid out"
        )
    features = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": np.round(x, 10).tolist()},
            "properties": {"image": image, "sigma_enu_m": np.round(sigma, 5).tolist()},
        }
        for image, x, sigma in zip(cameras.images, cameras.coordinates, cameras.sigma, strict=True)
    ]
    atomic_write(path, json.dumps({"type": "FeatureCollection", "features": features}) + "\n")


@dataclass(frozen=True)
class PositionFormat:
    """One format of positions.

    Attributes
    ----------
    product : str
        Its usual file name.
    write : callable
        Its writer.
    helper : str
        Module and function in `formats` that give what the program needs besides to read the file,
        as of `io.formats.exports.Export`.
    """

    product: str
    write: Callable[[PlacedCameras, Source], None]
    helper: str = ""


POSITION_FORMATS: dict[str, PositionFormat] = {
    "metashape": PositionFormat(
        "metashape_positions.csv",
        write_metashape_positions,
        "bundle.import_helpers:metashape_positions_script",
    ),
    "pix4d_matic": PositionFormat("pix4d_positions.csv", write_pix4d_positions),
    "pix4d_mapper": PositionFormat("pix4d_positions.csv", write_pix4d_positions),
    "odm": PositionFormat("geo.txt", write_odm_positions),
    "realitycapture_accuracy": PositionFormat(
        "realitycapture_positions.csv",
        write_realitycapture_positions,
        "bundle.import_helpers:flight_log_of_positions",
    ),
    "generic_ascii": PositionFormat("positions.csv", write_table_of_positions),
    "geojson": PositionFormat("positions.geojson", write_geojson_positions),
}
