"""`insgnss export --proof FORMAT DIR`, the scene in a format.

It comes with all that a tool needs to show its residuals.

The export goes the way of every other export. Beside it stand the images, the points as ground
control in the frame of the export, their pixels, the camera, and a README that says what to see.

The images show mottled ground, a cross on every point and the image's name. They are grey, 8 bits,
TIFF without compression.

Every pixel's ray is followed to the ground, so that tools find the same spots in all images. A
cross has its middle at the point's pixel coordinates, to a fraction of a pixel: its arms are drawn
by how much of each pixel they cover.
"""

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import UsageError
from ...base.files import atomic_write
from ...base.output.staging import is_vacant, together
from ...geodesy.projection import MapProjection
from ...io.formats.exports import Export
from ...navigation.orient.frame import in_frame
from ...records import Array
from ...records.framed import GEOCENTRIC, GEOGRAPHIC, PROJECTED, TANGENT
from ..exporting.export import ExportFrame, export, known_format
from .readme import readme
from .scene import (
    FIELD_M,
    FOCAL_PX,
    GROUND_M,
    HEIGHT_PX,
    PIXEL_UM,
    SCENE_CENTRE_PX,
    SITE_DEG,
    WIDTH_PX,
    Scene,
    make_scene,
    terrain,
)

Picture = NDArray[np.float64]

GREY, CONTRAST = 128.0, 30.0  # mean and amplitude of the ground, of 255: crosses stay the extremes
SPOTS_M = (2.1, 0.7, 0.31)  # sizes (m) of the mottles: some 4, 8 and 25 px from 120 m
LATTICE = 512  # random values a side of a mottle's pattern, which then repeats (chosen)
ARM_PX, HALF_PX = 12, 1.0  # length of a cross's arm, and half of its width
RAY_STEPS = 6  # towards the ground; each leaves a tenth of the error
BAND = 120  # rows that are drawn at a time: an eighth of an image, for memory
POINT_LETTERS_PX, NAME_LETTERS_PX = 16, 40  # heights of the letters


def write_pictures(scene: Scene, directory: Path) -> list[Path]:
    """Write every image of the scene (TIFF); return the files."""
    spots = np.random.default_rng(46).uniform(-1.0, 1.0, (len(SPOTS_M), LATTICE, LATTICE))
    files = []
    for index, name in enumerate(scene.eo.images):
        picture = _ground(scene.eo.C_mc[index], scene.eo.position_m[index], spots)
        drawn = zip(scene.names, scene.pixels[index], scene.visible[index], strict=True)
        for point, (column, row), visible in drawn:
            if visible:
                _draw_cross(picture, column, row)
                _draw_text(picture, point, int(column) + ARM_PX + 4, int(row) + 5, POINT_LETTERS_PX)
        _draw_text(picture, name.upper(), 20, 20, NAME_LETTERS_PX)
        files.append(directory / name)
        atomic_write(files[-1], tiff(np.clip(np.round(picture), 0, 255).astype(np.uint8)))
    return files


def tiff(picture: NDArray[np.uint8]) -> bytes:
    """A grey TIFF without compression."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "tiff", dpi=(300, 300))
    return stream.getvalue()


def _ground(C_mc: Array, centre: Array, spots: Array) -> Picture:
    """What the camera sees of the mottled ground, (rows, columns)."""
    x = (np.arange(WIDTH_PX) + 0.5 - SCENE_CENTRE_PX[0]) / FOCAL_PX
    out = np.empty((HEIGHT_PX, WIDTH_PX))
    above = centre - [*FIELD_M, 0.0]
    for top in range(0, HEIGHT_PX, BAND):
        y = (np.arange(top, min(top + BAND, HEIGHT_PX)) + 0.5 - SCENE_CENTRE_PX[1]) / FOCAL_PX
        ray = (
            np.stack(
                [*np.broadcast_arrays(x[None], y[:, None]), np.ones((len(y), WIDTH_PX))], axis=-1
            )
            @ C_mc.T
        )
        up: Array = np.zeros(ray.shape[:2])
        for _ in range(RAY_STEPS):
            way = (up - above[2]) / ray[..., 2]
            east, north = above[0] + way * ray[..., 0], above[1] + way * ray[..., 1]
            up = terrain(east, north)
        out[top : top + len(y)] = GREY + CONTRAST * sum(
            _lattice_grey(s, east / m, north / m) for s, m in zip(spots, SPOTS_M, strict=True)
        )
    return out


def _lattice_grey(values: Array, u: Array, v: Array) -> Array:
    """Return grey values at (u, v), bilinear in a lattice that repeats itself."""
    row, column = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
    row_share, column_share = u - row, v - column
    row, column = row % LATTICE, column % LATTICE
    next_row, next_column = (row + 1) % LATTICE, (column + 1) % LATTICE
    return np.asarray(
        (1 - row_share)
        * ((1 - column_share) * values[row, column] + column_share * values[row, next_column])
        + row_share
        * (
            (1 - column_share) * values[next_row, column]
            + column_share * values[next_row, next_column]
        )
    )


def _draw_cross(picture: Picture, x: float, y: float) -> None:
    """Draw white arms with black edges, their middle at (x, y), px."""
    left, top = max(int(x) - ARM_PX, 0), max(int(y) - ARM_PX, 0)
    window = picture[top : int(y) + ARM_PX + 1, left : int(x) + ARM_PX + 1]
    dx = np.abs(left + np.arange(window.shape[1]) + 0.5 - x)
    dy = np.abs(top + np.arange(window.shape[0]) + 0.5 - y)
    for half, grey in ((HALF_PX + 1.5, 0.0), (HALF_PX, 255.0)):
        width_cover, height_cover = (
            np.clip(half + 0.5 - distance, 0.0, 1.0) for distance in (dx, dy)
        )
        covered = np.maximum(width_cover[None, :], height_cover[:, None])
        window[:] = (1.0 - covered) * window + covered * grey


def _draw_text(picture: Picture, text: str, x: int, y: int, height: int) -> None:
    """Black letters of `height` pixels on a white field, as far as they lie in the picture."""
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(height)
    x_first, top, right, bottom = font.getbbox(text)
    edge = height // 4
    field = Image.new("L", (round(right - x_first) + 2 * edge, round(bottom - top) + 2 * edge), 255)
    ImageDraw.Draw(field).text((edge - x_first, edge - top), text, fill=0, font=font)
    window = picture[y : y + field.height, x : x + field.width]
    window[:] = np.asarray(field)[: window.shape[0], : window.shape[1]]


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
