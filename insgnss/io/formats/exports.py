"""The formats that an exterior orientation is written to, with the frames that each can carry.

A writer is a pure function of a `FramedOrientation` in one of its frames and a path; what it needs
besides are its options. `eo_json` is the master and takes the `ExteriorOrientation` itself.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any, Literal

from ...base.errors import UsageError
from ...records import FramedOrientation
from ...records.framed import GEOCENTRIC, GEOGRAPHIC, PROJECTED, TANGENT

GIVEN = ("undulation_m", "relative")  # parameters of writers that the export itself gives
Heights = Literal["", "ellipsoid", "sea level"]


@dataclass(frozen=True)
class Export:
    """One format.

    Attributes
    ----------
    product : str
        Its usual file name.
    what : str
        One line of description for users.
    writer : str
        Module and function in `formats`; it may return sentences that its reader must know.
    frames : tuple of str
        Kinds of frame that it can carry, by default the first that needs no CRS; none for the
        master.
    heights : str
        What its consumer counts heights from: what the frame says (""), or always the ellipsoid of
        WGS84, or sea level.
    several : bool
        Whether it is a directory of files.
    needs : tuple of str
        Those of the options that have no default.
    crs_order : bool
        Whether coordinates stand in the order that the CRS itself has; in all others easting comes
        first.
    of_control : tuple of str
        Options of the relative control that the writer is given (`navigation.orient.relative`).
    relative : bool
        Whether the writer takes relative control (`navigation.orient.relative`) instead of the
        orientation.
    without_geoid : str
        What a user without a grid of geoid heights can give in its place, by the option `altitude`;
        empty where nothing.
    of_one_camera : tuple of str
        Those of the options that describe a single camera, so that images of several cannot be
        written with them.
    helper : str
        Module and function that give what the program needs besides to read the file, texts by
        path; empty where it needs nothing.
    any_unit : bool
        Whether a projected CRS may count in feet: positions and their standard deviations stand in
        its unit then.
    frame : str
        Module and function that turn a frame into the one that the file is really in; empty where
        it stays.
    separator : str
        What a name of an image must not have, as the program knows no quotation marks: "," or " "
        (any blank); empty where every name can be held.
    """

    product: str
    what: str
    writer: str
    frames: tuple[str, ...]
    heights: Heights = ""
    several: bool = False
    needs: tuple[str, ...] = ()
    crs_order: bool = False
    of_control: tuple[str, ...] = ()
    relative: bool = False
    any_unit: bool = False
    frame: str = ""
    without_geoid: str = ""
    separator: str = ""
    helper: str = ""
    of_one_camera: tuple[str, ...] = ()

    @property
    def function(self) -> Callable[..., Any]:
        """The writer."""
        return function_at(self.writer)

    def write(self, eo: Any, path: Path, **options: Any) -> Any:
        """Write what the writer takes; UsageError for a frame that the format cannot carry."""
        if self.frames and not self.relative:
            name = next(name for name, form in EXPORTS.items() if form == self)
            check_frame(eo, name, self.frames)
        return self.function(eo, path, **options)

    @cached_property
    def options(self) -> tuple[str, ...]:
        """What the caller may give: what the writer takes besides, and those of its control."""
        parameters = list(signature(self.function).parameters)[2:]
        return (*(key for key in parameters if key not in GIVEN), *self.of_control)

    @property
    def page(self) -> str:
        """The page of `data_specs` that states the format."""
        return self.writer.partition(":")[0].rpartition(".")[2]

    def helpers(self, eo: FramedOrientation, path: Path) -> dict[Path, str]:
        """Return what the program needs besides to read `path`, texts by path."""
        return dict(function_at(self.helper)(eo, path)) if self.helper else {}

    def in_own_frame(self, eo: FramedOrientation) -> FramedOrientation:
        """Return `eo` in the frame that the file is really in."""
        return function_at(self.frame)(eo) if self.frame else eo


def check_frame(eo: FramedOrientation, name: str, kinds: tuple[str, ...]) -> None:
    """Refuse a frame whose kind is none of `kinds`, for the format `name`."""
    if eo.frame.kind not in kinds:
        raise UsageError(
            f"{name} cannot carry a {eo.frame.kind} frame ({eo.frame.name}); it takes"
            f" {', '.join(kinds)}"
        )


def function_at(location: str) -> Callable[..., Any]:
    """Import the function that "module:name" names inside this room, when it is used."""
    module, _, name = location.partition(":")
    return getattr(import_module(f".{module}", __package__), name)


_REFERENCE_TITLE = "Metashape camera reference: "
_METASHAPE = Export(
    "metashape.csv",
    _REFERENCE_TITLE + "longitude latitude height, yaw pitch roll (true north), accuracies",
    "bundle.metashape:write_metashape",
    (GEOGRAPHIC, PROJECTED, TANGENT),
    any_unit=True,
    separator=",",
    helper="bundle.import_helpers:metashape_script",
)
_FLIGHT_LOG = Export(
    "realitycapture.csv",
    "RealityCapture/RealityScan flight log, yaw pitch roll",
    "bundle.realitycapture:write_realitycapture",
    (GEOGRAPHIC, TANGENT),
    separator=",",
    helper="bundle.import_helpers:flight_log_format",
)
EXPORTS: dict[str, Export] = {
    "eo_local_plane": Export(
        "EO_local-plane.txt",
        "tangent plane, omega phi kappa, standard deviations; blank separated text",
        "orientation.eo_local_plane:write_eo_local_plane",
        (TANGENT,),
    ),
    "metashape": _METASHAPE,
    "metashape_opk": replace(
        _METASHAPE,
        product="metashape_opk.csv",
        what=_REFERENCE_TITLE + "omega phi kappa of the grid",
        writer="bundle.metashape:write_metashape_opk",
        frames=(PROJECTED, GEOGRAPHIC, TANGENT),
    ),
    "metashape_offset": replace(
        _METASHAPE,
        product="metashape_offset.csv",
        what=_REFERENCE_TITLE + "bore-sight as GPS/INS offset beside, not in the angles",
        writer="bundle.metashape:write_metashape_offset",
    ),
    "pix4d_matic": Export(
        "pix4d_matic.csv",
        "PIX4Dmatic geolocation and orientation",
        "bundle.pix4d:write_pix4d_matic",
        (GEOGRAPHIC, PROJECTED),
        crs_order=True,
        any_unit=True,
        separator=",",
    ),
    "pix4d_mapper": Export(
        "pix4d_mapper.csv",
        "PIX4Dmapper: X Y Z omega phi kappa",
        "bundle.pix4d:write_pix4d_mapper",
        (PROJECTED, TANGENT),
        any_unit=True,
        separator=",",
    ),
    "odm": Export(
        "geo.txt",
        "OpenDroneMap: positions and accuracies",
        "bundle.odm:write_odm_geo",
        (GEOGRAPHIC, PROJECTED),
        separator=" ",
    ),
    "opensfm": Export(
        "exif_overrides.json",
        "OpenSfM: positions and omega phi kappa, reference_lla.json beside",
        "bundle.opensfm:write_opensfm",
        (TANGENT,),
        heights="ellipsoid",
    ),
    "micmac": Export(
        "micmac.txt",
        "MicMac OriConvert text",
        "bundle.micmac:write_micmac",
        (TANGENT, GEOCENTRIC),
        separator=" ",
        helper="bundle.import_helpers:tangent_system",
    ),
    "micmac_xml": Export(
        "Ori-Nav",
        "MicMac Orientation-*.xml, one an image",
        "bundle.micmac:write_micmac_xml",
        (TANGENT, GEOCENTRIC),
        of_one_camera=("calibration",),
        several=True,
        helper="bundle.import_helpers:tangent_system",
    ),
    "realitycapture": _FLIGHT_LOG,
    "realitycapture_accuracy": replace(
        _FLIGHT_LOG,
        product="realitycapture_accuracy.csv",
        what="RealityCapture/RealityScan flight log with accuracies",
        writer="bundle.realitycapture:write_realitycapture_accuracy",
    ),
    "bentley": Export(
        "blocks.xml",
        "BlocksExchange XML of ContextCapture",
        "bundle.bentley:write_bentley",
        (PROJECTED, TANGENT, GEOGRAPHIC),
        of_one_camera=("width_px", "height_px", "focal_px"),
        frame="bundle.bentley:on_ellipsoid",
        any_unit=True,
    ),
    "inpho_prj": Export(
        "inpho.prj",
        "Inpho photo blocks",
        "bundle.inpho:write_inpho_prj",
        (PROJECTED, TANGENT),
        of_one_camera=("focal_mm",),
        needs=("focal_mm", "ground_m"),
        any_unit=True,
    ),
    "inpho_ascii": Export(
        "inpho.txt",
        "Inpho GNSS/INS table",
        "bundle.inpho:write_inpho_ascii",
        (PROJECTED, TANGENT),
        any_unit=True,
        separator=" ",
    ),
    "generic_ascii": Export(
        "eo_table.txt",
        "a table by template: columns, angle set, units, delimiter",
        "orientation.generic_ascii:write_generic_ascii",
        (TANGENT, PROJECTED, GEOGRAPHIC, GEOCENTRIC),
        any_unit=True,
    ),
    "colmap": Export(
        "colmap",
        "COLMAP text model with known poses",
        "bundle.colmap:write_colmap",
        (TANGENT, PROJECTED, GEOCENTRIC),
        several=True,
        needs=("camera",),
        separator=" ",
    ),
    "colmap_priors": Export(
        "database.db",
        "COLMAP database with pose priors: full position covariance, gravity (pycolmap)",
        "bundle.colmap:write_colmap_priors",
        (TANGENT, PROJECTED, GEOCENTRIC, GEOGRAPHIC),
        needs=("camera",),
    ),
    "opf": Export(
        "opf",
        "OPF project of Pix4D: omega phi kappa, full covariance",
        "bundle.opf:write_opf",
        (PROJECTED,),
        several=True,
        needs=("camera", "pixel_size_um"),
        crs_order=True,
    ),
    "tum": Export(
        "eo.tum",
        "TUM trajectory, for evo",
        "orientation.tum:write_tum",
        (TANGENT, PROJECTED, GEOCENTRIC),
    ),
    "g2o": Export(
        "eo.g2o",
        "pose graph: neighbours with full 6x6 information",
        "orientation.g2o:write_g2o",
        (TANGENT, PROJECTED, GEOCENTRIC),
    ),
    "relative": Export(
        "relative.csv",
        "relative position and attitude of neighbouring images, three weightings side by side",
        "orientation.relative_csv:write_relative_csv",
        (TANGENT, PROJECTED, GEOCENTRIC),
        of_control=("noise", "form", "gap_s"),
        needs=("noise",),
        relative=True,
    ),
    "geojson": Export(
        "eo.geojson",
        "GeoJSON, or orthority's dialect",
        "gis.geojson:write_geojson",
        (GEOGRAPHIC, PROJECTED, TANGENT, GEOCENTRIC),
        heights="ellipsoid",
        of_one_camera=("camera",),
        any_unit=True,
    ),
    "kml": Export(
        "eo.kml",
        "KML: track and photographs above sea level, or above the ground without a geoid",
        "gis.kml:write_kml",
        (GEOGRAPHIC, PROJECTED, TANGENT, GEOCENTRIC),
        heights="sea level",
        without_geoid=(
            ", or --set altitude=relative --set ground_m=M (of the ground above the ellipsoid),"
            " or --set altitude=clamped"
        ),
        any_unit=True,
    ),
    "geopackage": Export(
        "eo.gpkg",
        "GeoPackage: images and track",
        "gis.geopackage:write_geopackage",
        (GEOGRAPHIC, PROJECTED, TANGENT),
        any_unit=True,
    ),
    "image_tags": Export(
        "tagged_images",
        "copies of the images with Exif GPS and XMP",
        "images.image_tags:write_image_tags",
        (GEOGRAPHIC, PROJECTED, TANGENT, GEOCENTRIC),
        several=True,
        needs=("images",),
        any_unit=True,
    ),
    "rtklib_pos": Export(
        "antenna.pos",
        "RTKLIB .pos of the antenna at the exposures",
        "gnss.rtklib_pos_write:write_antenna_pos",
        (GEOGRAPHIC, PROJECTED, TANGENT, GEOCENTRIC),
        heights="ellipsoid",
        of_one_camera=("lever_m",),
        needs=("lever_m",),
        any_unit=True,
    ),
    "eo_json": Export(
        "eo.json",
        "master: full covariances, cross-covariances of neighbours, ECEF and tangent plane",
        "orientation.eo_json:write_eo_json",
        (),
        of_control=("noise", "form", "gap_s"),
    ),
}
