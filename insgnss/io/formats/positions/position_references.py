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
from ....records.framed import GEOGRAPHIC
from ..orientation.ascii_columns import numbers_of, write_columns
from ..orientation.exported import PlacedCameras
from ..text.text import Source


def write_metashape_positions(cameras: PlacedCameras, path: Source) -> None:
    """Write Metashape's reference csv without angles; import with columns "nxyXYZ" in its order.

    Raises
    ------
    InputError
        Names with commas.
    """
    frame = cameras.frame
    first = ("X", "Y", "Z")
    if frame.kind != GEOGRAPHIC:
        name = frame.name.replace(",", ";")
        first = (f"Easting ({name}; heights {frame.heights})", "Northing", "Height")
    head = ",".join(("#Label", *first, "X_acc", "Y_acc", "Z_acc")) + "\n"
    write_columns(cameras, path, "image xyz s_xyz", ",", head)


def write_pix4d_positions(cameras: PlacedCameras, path: Source) -> None:
    """Write PIX4D's geolocation file: image, coordinates in the system's own order, accuracies.

    Raises
    ------
    InputError
        Names with commas.
    """
    plan = "y x" if cameras.frame.northing_first else "x y"
    write_columns(cameras, path, f"image {plan} z s_plan", ",")


def write_odm_positions(cameras: PlacedCameras, path: Source) -> None:
    """Write OpenDroneMap's geo.txt without angles.

    Raises
    ------
    UsageError
        A reference system without EPSG code.
    InputError
        Names with blanks.
    """
    code = "EPSG:4326" if cameras.frame.kind == GEOGRAPHIC else cameras.frame.name
    if not code.startswith("EPSG:"):
        raise UsageError(
            f"odm: {code} has no EPSG code, which the first line of geo.txt needs; export a CRS"
            " that has, or geographic"
        )
    columns = "image xyz NaN NaN NaN s_plan"
    write_columns(cameras, path, columns, " ", f"{code.split()[0]}\n")


def write_realitycapture_positions(cameras: PlacedCameras, path: Source) -> None:
    """Write a flight log of RealityCapture without angles, with accuracies.

    Raises
    ------
    InputError
        Names with commas.
    """
    geographic = cameras.frame.kind == GEOGRAPHIC
    plan, plan_header = ("y x", "latitude,longitude") if geographic else ("x y", "x,y")
    head = f"#name,{plan_header},altitude,accX,accY,accZ\n"
    write_columns(cameras, path, f"image {plan} z s_xyz", ",", head)


def write_table_of_positions(cameras: PlacedCameras, path: Source) -> None:
    """Write a table with a header: image, coordinates, standard deviations east, north, up, m.

    Raises
    ------
    InputError
        Names with commas.
    """
    frame = cameras.frame
    plan = "longitude_deg,latitude_deg" if frame.kind == GEOGRAPHIC else "easting_m,northing_m"
    head = f"# {frame.name}; heights {frame.heights}\n"
    head += f"image,{plan},height_m,sigma_east_m,sigma_north_m,sigma_up_m\n"
    write_columns(cameras, path, "image xyz s_xyz", ",", head)


def write_geojson_positions(cameras: PlacedCameras, path: Source) -> None:
    """Write GeoJSON: a point an image, with its standard deviations east, north, up, m.

    Raises
    ------
    UsageError
        Projected coordinates and heights above a geoid, which the format does not know.
    """
    if cameras.frame.kind != GEOGRAPHIC or "ellipsoid" not in cameras.frame.heights:
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
        for image, x, sigma in zip(
            cameras.images, numbers_of(cameras, "xyz"), numbers_of(cameras, "s_xyz"), strict=True
        )
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
        "bundle.import_helpers:metashape_script",
    ),
    "pix4d_matic": PositionFormat("pix4d_positions.csv", write_pix4d_positions),
    "pix4d_mapper": PositionFormat("pix4d_positions.csv", write_pix4d_positions),
    "odm": PositionFormat("geo.txt", write_odm_positions),
    "realitycapture_accuracy": PositionFormat(
        "realitycapture_positions.csv",
        write_realitycapture_positions,
        "bundle.import_helpers:flight_log_format",
    ),
    "generic_ascii": PositionFormat("positions.csv", write_table_of_positions),
    "geojson": PositionFormat("positions.geojson", write_geojson_positions),
}
