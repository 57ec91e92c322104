"""`insgnss export --proof FORMAT DIR`, the scene in a format.

It comes with all that a tool needs to show its residuals.

The export goes the way of every other export. Beside it stand the images, the points as ground
control in the frame of the export, their pixels, the camera, and a README that says what to see.
"""

from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import UsageError
from ...base.files import atomic_write
from ...base.output.staging import is_vacant, together
from ...geodesy.projection import MapProjection
from ...io.formats.exports import Export
from ...navigation.orient.frame import in_frame
from ...records import Array
from ...records.framed import GEOCENTRIC, GEOGRAPHIC, PROJECTED, TANGENT
from ..exporting.export import ExportFrame, export, known_format
from .pictures import write_pictures
from .readme import readme
from .scene import (
    FOCAL_PX,
    GROUND_M,
    HEIGHT_PX,
    PIXEL_UM,
    SCENE_CENTRE_PX,
    SITE_DEG,
    WIDTH_PX,
    Scene,
    make_scene,
)

NOISE = "navchip"
LEVER_C = (0.462, -0.001, -0.065)  # from the camera to the antenna (m) (chosen)
HEADERS_OF_FRAME = {
    TANGENT: ("E_m", "N_m", "U_m"),
    GEOCENTRIC: ("X_m", "Y_m", "Z_m"),
    GEOGRAPHIC: ("longitude_deg", "latitude_deg", "height_m"),
    PROJECTED: ("easting_m", "northing_m", "height_m"),
}
CAMERA_LINE = (
    f"PINHOLE {WIDTH_PX} {HEIGHT_PX} {FOCAL_PX:g} {FOCAL_PX:g} "
    f"{SCENE_CENTRE_PX[0]:g} {SCENE_CENTRE_PX[1]:g}"
)


def write_proof(
    name: str,
    directory: Path,
    crs: str | None = None,
    geoid: Path | None = None,
    frame: str | None = None,
    ground_m: float | None = None,
) -> tuple[Path, ...]:
    """Write the scene as format `name` into `directory`, which is made: all of it, or nothing.

    The files, export and README.txt first.

    Parameters
    ----------
    crs, geoid, frame, ground_m : as of `ExportFrame`; a format that needs a CRS and gets none has
    that
        of the UTM zone.

    Raises
    ------
    UsageError
        For an unknown format, a directory with content and what `export` refuses; InputError where
        a CRS does not reach.
    """
    export_format, directory = known_format(name), Path(directory)
    if not is_vacant(directory):
        raise UsageError(f"{directory}: is not an empty directory; give a new one for the proof")
    usual_frame = next(
        (kind for kind in export_format.frames if kind != PROJECTED),
        PROJECTED if export_format.frames else TANGENT,
    )
    if crs is None and (frame or usual_frame) == PROJECTED:
        crs = f"EPSG:{32601 + int((SITE_DEG[1] + 180.0) // 6.0)}"
    target = ExportFrame(crs, geoid, frame, ground_m)
    projection = None if crs is None else MapProjection(crs, geoid)
    kind = PROJECTED if projection is not None else target.frame or usual_frame
    scene = make_scene(projection)
    with together() as staging:
        work = staging.tree(directory)
        images = work / "images"
        images.mkdir()
        write_pictures(scene, images)
        exported = export(
            scene.eo,
            name,
            work / export_format.product,
            target,
            **_options(name, export_format, images),
        )
        heights = {
            PROJECTED: projection.heights if projection is not None else "",
            GEOGRAPHIC: "above the ellipsoid of WGS84",
        }.get(kind)
        frame_text, up = (
            _tangent(scene, export_format) if kind == TANGENT else (exported.frame, 0.0)
        )
        frame_text = f"{frame_text}, heights {heights}" if heights else frame_text
        companions = {
            "README.txt": readme(
                scene, name, export_format, exported, frame_text, projection, ground_m
            ),
            **_companion_texts(scene, kind, projection, frame_text, up),
        }
        for file, text in companions.items():
            atomic_write(work / file, text)
    first_files = [directory / file for file in (export_format.product, "README.txt")]
    return (
        *first_files,
        *(
            file
            for file in sorted(directory.rglob("*"))
            if file.is_file() and file not in first_files
        ),
    )


def _options(name: str, export_format: Export, images: Path) -> dict[str, Any]:
    """What the format asks for, of this scene."""
    values: dict[str, Any] = {
        "focal_mm": 1e-3 * PIXEL_UM * FOCAL_PX,
        "width_px": WIDTH_PX,
        "height_px": HEIGHT_PX,
        "focal_px": FOCAL_PX,
        "pixel_size_um": PIXEL_UM,
        "images": "images" if name == "opf" else images,
        "lever_m": LEVER_C,
    }
    if "ground_m" in export_format.needs:  # of kml it belongs to heights above the ground
        values["ground_m"] = GROUND_M
    if "camera" in export_format.needs:
        values["camera"] = CAMERA_LINE
    if "noise" in export_format.needs:
        values["noise"] = NOISE
    return {key: values[key] for key in export_format.options if key in values}


def _tangent(scene: Scene, form: Export) -> tuple[str, float]:
    """The tangent plane of a format in words, and how far, m, its origin lies below the scene's."""
    eo = in_frame(scene.eo, TANGENT)
    framed = form.in_own_frame(eo)
    return framed.frame.name, eo.frame.origin[2] - framed.frame.origin[2]


def _companion_texts(
    scene: Scene, kind: str, projection: MapProjection | None, frame: str, up: float
) -> dict[str, str]:
    """Points in the frame of the export and on the globe, their pixels, the camera, by file name.

    A tangent plane of the export lies `up` m lower.
    """
    lat, lon, h = scene.geodetic.T
    globe = np.column_stack([np.degrees(lon), np.degrees(lat), h])
    if projection is not None:
        x = projection.forward(lat, lon, h)
    elif kind == GEOGRAPHIC:
        x = globe
    else:
        x = (
            scene.points + [0.0, 0.0, up]
            if kind == TANGENT
            else scene.plane.origin_ecef + scene.points @ scene.plane.C_em.T
        )
    pixels = "".join(
        f"{image},{point},{x:.4f},{y:.4f}\n"
        for image, row, visible in zip(scene.eo.images, scene.pixels, scene.visible, strict=True)
        for point, (x, y), in_image in zip(scene.names, row, visible, strict=True)
        if in_image
    )
    calibration = [
        f"width_px {WIDTH_PX}",
        f"height_px {HEIGHT_PX}",
        f"focal_px {FOCAL_PX:.4f}",
        f"principal_point_px {SCENE_CENTRE_PX[0]:.4f} {SCENE_CENTRE_PX[1]:.4f}",
        "distortion none",
        f"pixel_size_um {PIXEL_UM:g}",
        f"colmap {CAMERA_LINE}",
    ]
    return {
        "points.csv": _points(scene, x, HEADERS_OF_FRAME[kind], frame),
        "points_geographic.csv": _points(
            scene, globe, HEADERS_OF_FRAME[GEOGRAPHIC], "WGS84, heights above the ellipsoid"
        ),
        "pixels.csv": (
            "# pixels from the outer corner of the first one, x right, y down\n#image,point,x,y\n"
            + pixels
        ),
        "camera.txt": (
            "# pixels from the outer corner of the first one, x right, y down\n"
            + "".join(f"{line}\n" for line in calibration)
        ),
    }


def _points(scene: Scene, x: Array, axes: tuple[str, ...], frame: str) -> str:
    forms = ["%.10f" if axis.endswith("_deg") else "%.4f" for axis in axes]
    rows = "".join(
        f"{name},{','.join(forms) % tuple(row)}\n"
        for name, row in zip(scene.names, x.tolist(), strict=True)
    )
    return f"# {frame}\n#point,{','.join(axes)}\n{rows}"
