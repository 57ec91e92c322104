"""Pictures of the ground for the map of a page: GeoTIFF and MBTiles, drawn anew in a local frame.

A GeoTIFF has its place in tags (OGC 19-008r4): 33550 and 33922, or 34264, lead from pixels to
coordinates, 34735 names their CRS by its EPSG code. MBTiles 1.3 is an SQLite database of tiles in
EPSG:3857, whose rows count from the south. Nothing is asked for from a network.
"""

import io
import sqlite3
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ....base.errors import InputError, UsageError
from ....base.inputs import open_bytes
from ....geodesy.crs import crs_of, source_crs, transform_points, transformer_between
from ....geodesy.frames import LocalFrame
from ....records import Array
from ..text.database import is_database, opened_database

# of the picture: twice the width that the map has on a screen
PICTURE_WIDTH_PX, PICTURE_HEIGHT_PX = (1600, 840)
# half the picture by half of what the flight covers: the map shows 1 / 0.92 of it
PICTURE_MARGIN = 1.2
WITHOUT_OUTLIERS = (0.5, 99.5)  # percentiles of the places: a fix may be 50 km off
LEAST_REACH_M = 50.0  # half height of the picture (m): of a flight that stays at one place (chosen)
# side of the net of points that PROJ transforms: between them a map of 20 km bends by 1 mm
NET_SIDE = 33
LARGEST_RASTER_PX = 100_000_000  # pixels of a raster that is unpacked whole: 0.3 GB of RGB
MOST_TILES = 200  # tiles that are put together: the picture needs 40 of 256 px
LARGEST_TILE_PX = 1024  # side of a tile: writers make 256 and 512
MERCATOR_M = 20_037_508.342789244  # half the side of EPSG:3857, m: pi times 6 378 137 m
# tags of TIFF: sizes of a pixel, a tie point, a matrix, the keys; whether a page is an overview
SCALE_TAG, TIE_TAG, MATRIX_TAG, KEYS_TAG, REDUCED_TAG = 33550, 33922, 34264, 34735, 254
RASTER_KEY, RASTER_POINT = 1025, 2  # key of what a pixel is, and its value for a point: GeoTIFF
# keys of projected and geographic CRS, and no code: GeoTIFF
CRS_KEYS, USER_DEFINED = (3072, 2048), 32767
# 8 bits a band
LONGEST_REASON = 160  # characters of a library's message (-): what follows is a dump of bytes
EIGHT_BIT_MODES = ("1", "L", "LA", "P", "PA", "RGB", "RGBA", "RGBX", "CMYK", "YCbCr")
BACKGROUNDS = "GeoTIFF of 8 bits a band with an EPSG code, or MBTiles of pictures"
REWRITE = "write it anew by gdal_translate or gdalwarp"


@dataclass(frozen=True, eq=False)
class GroundPicture:
    """A picture whose rows lead south and whose columns lead east in a local frame.

    Parameters
    ----------
    pixels : ndarray of uint8, (h, w, 3)
        Red, green, blue; white where the file has nothing.
    edges : tuple of float
        West, south, east and north, m.
    """

    pixels: Any
    edges: tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class _Raster:
    """A part of a raster: its pixels (h, w, 4), and from coordinates to its columns and rows."""

    rgba: Any
    columns_rows: Callable[[Array, Array], tuple[Array, Array]]


def read_background(
    path: Path,
    frame: LocalFrame,
    places: Array,
    datum: str | None = None,
    epoch: float | None = None,
) -> GroundPicture:
    """Read the ground below a flight.

    Parameters
    ----------
    path : Path
        A GeoTIFF, or MBTiles.
    frame : LocalFrame
        The frame of the map.
    places : ndarray, (n, 3)
        Where the flight was, latitude and longitude, rad, and height, m: the picture lies at their
        median height, as the flight is drawn above what is below it.
    datum, epoch
        Those of `places`, as `geodesy.crs.source_crs` takes them.

    Returns
    -------
    GroundPicture
        The picture.

    Raises
    ------
    InputError
        The file cannot be read, is of another kind, says no place, or shows another place.
    """
    north, east, _ = frame.position_from_geodetic(*places.T).T
    low, high = np.percentile([east, north], WITHOUT_OUTLIERS, axis=1)
    middle, half_extent = 0.5 * (low + high), 0.5 * PICTURE_MARGIN * (high - low)
    half = max(
        float(half_extent[1]),
        float(half_extent[0]) * PICTURE_HEIGHT_PX / PICTURE_WIDTH_PX,
        LEAST_REACH_M,
    )
    wide = half * PICTURE_WIDTH_PX / PICTURE_HEIGHT_PX
    x, y = map(float, middle)
    edges = (x - wide, y - half, x + wide, y + half)
    net_east, net_north = np.meshgrid(
        np.linspace(edges[0], edges[2], NET_SIDE), np.linspace(edges[3], edges[1], NET_SIDE)
    )
    down = frame.height - float(np.median(places[:, 2]))
    level = np.stack([net_north, net_east, np.full(net_east.shape, down)], axis=-1)
    lat, lon, height = frame.geodetic_from_position(level)

    def net_of(crs: Any) -> tuple[Array, Array]:
        source = source_crs(datum, epoch)
        x, y, z = (a.ravel() for a in (np.degrees(lon), np.degrees(lat), height))
        step = transformer_between(source, crs)
        x, y, _ = transform_points(step, f"CRS {crs.name}", x, y, z, epoch=epoch)
        return x.reshape(NET_SIDE, NET_SIDE), y.reshape(NET_SIDE, NET_SIDE)

    try:
        raster = _tiles(path, net_of) if is_database(path) else _geotiff(path, net_of)
    except OSError as error:
        raise InputError.unread(path, error, "check path and permission") from None
    except UsageError as error:
        raise InputError.in_file(path, str(error)) from None
    return GroundPicture(_resample_raster(path, raster, net_of, lat, lon), edges)


def _resample_raster(path: Path, raster: Any, net_of: Any, lat: Array, lon: Array) -> Any:
    """Return the pixels (h, w, 3) of the picture: the raster where its points lie in it."""
    from scipy.ndimage import map_coordinates

    picture_part, crs = raster
    column_net = (np.arange(PICTURE_WIDTH_PX) + 0.5) / PICTURE_WIDTH_PX * (NET_SIDE - 1)
    row_net = (np.arange(PICTURE_HEIGHT_PX) + 0.5) / PICTURE_HEIGHT_PX * (NET_SIDE - 1)
    grid = np.meshgrid(row_net, column_net, indexing="ij")
    columns, rows = (
        map_coordinates(net, grid, order=1) for net in picture_part.columns_rows(*net_of(crs))
    )
    height, width = picture_part.rgba.shape[:2]
    inside = (columns > -0.5) & (columns < width - 0.5) & (rows > -0.5) & (rows < height - 0.5)
    bands = [
        map_coordinates(
            picture_part.rgba[..., k].astype(np.float32), (rows, columns), order=1, mode="nearest"
        )
        for k in range(4)
    ]
    alpha = np.where(inside, bands[3], 0.0) / 255.0
    if not alpha.any():
        ends = (
            f"{np.degrees(angles.min()):.4f} to {np.degrees(angles.max()):.4f}"
            for angles in (lat, lon)
        )
        raise InputError.in_file(
            path,
            "shows nothing of the flight, which is at latitudes {} and longitudes {}; give a"
            " picture of that place".format(*ends),
        )
    picture = [255.0 + alpha * (band - 255.0) for band in bands[:3]]
    return np.clip(np.rint(np.stack(picture, axis=-1)), 0, 255).astype(np.uint8)


def _geotiff(path: Path, net_of: Any) -> tuple[_Raster, Any]:
    """Return the part of a GeoTIFF that the net covers, and its CRS."""
    from PIL import Image

    image: Any
    default_limit = Image.MAX_IMAGE_PIXELS
    Image.MAX_IMAGE_PIXELS = None  # overviews are read of larger ones
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            with open_bytes(path) as stream, Image.open(stream) as image:
                if image.format != "TIFF":
                    raise ValueError(f"it is {image.format}")
                to_pixel, crs = _georeference(path, dict(image.tag_v2))
                return _covered_part(image, to_pixel, net_of(crs)), crs
        except (OSError, SyntaxError, ValueError, KeyError) as error:
            if isinstance(error, OSError) and error.errno is not None:
                raise
            unknown = isinstance(error, Image.UnidentifiedImageError)
            reason = "not a picture" if unknown else " ".join(str(error).split())[:LONGEST_REASON]
            raise InputError.in_file(path, f"is no {BACKGROUNDS} ({reason}); {REWRITE}") from None
        finally:
            Image.MAX_IMAGE_PIXELS = default_limit


def _covered_part(image: Any, to_pixel: Any, net: tuple[Array, Array]) -> _Raster:
    """Return the pixels that the net covers, of the overview that suits the picture."""
    columns, rows = to_pixel(*net)
    finest = max(float(np.ptp(columns)) / PICTURE_WIDTH_PX, float(np.ptp(rows)) / PICTURE_HEIGHT_PX)
    width, height = image.size
    _seek_overview(image, finest)
    if image.mode not in EIGHT_BIT_MODES:
        raise ValueError(f"its pixels are of mode {image.mode}")
    if image.width * image.height > LARGEST_RASTER_PX:
        size = f"{image.width} x {image.height} pixels"
        raise ValueError(f"{size}, at most {LARGEST_RASTER_PX} without overviews")
    overview_scale = (width / image.width, height / image.height)
    corner, end = [], []
    for pixels, scale, side in zip((columns, rows), overview_scale, image.size, strict=True):
        corner.append(max(int(pixels.min() / scale) - 2, 0))
        end.append(min(int(pixels.max() / scale) + 3, side))
    if corner[0] >= end[0] or corner[1] >= end[1]:
        corner, end = [0, 0], [1, 1]  # beside the flight, as `_resample_raster` says
    rgba, shrink = _reduce_resolution(image.crop((*corner, *end)), finest / max(overview_scale))

    def columns_rows(x: Array, y: Array) -> tuple[Array, Array]:
        of_axes = zip(to_pixel(x, y), overview_scale, corner, strict=True)
        column, row = ((pixel / scale - low) / shrink - 0.5 for pixel, scale, low in of_axes)
        return column, row

    return _Raster(rgba, columns_rows)


def _seek_overview(image: Any, finest: float) -> None:
    """Go to the smallest overview of a file whose pixels are no larger than those wanted."""
    full_size, best_frame = image.size, (image.width, 0)
    for frame in range(1, getattr(image, "n_frames", 1)):
        image.seek(frame)
        reduced = image.tag_v2.get(REDUCED_TAG, 0) == 1  # 4 and 5 are masks
        if reduced and full_size[0] / image.width <= finest and image.width < best_frame[0]:
            best_frame = (image.width, frame)
    image.seek(best_frame[1])


def _reduce_resolution(image: Any, finest: float) -> tuple[Any, int]:
    """Return the pixels (h, w, 4), joined where those of the picture are coarser."""
    shrink = max(int(finest), 1)
    has_alpha = "A" in image.getbands() or "transparency" in image.info
    image = image.convert("RGBA") if has_alpha else image.convert("RGB").convert("RGBA")
    return np.asarray(image.reduce(shrink) if shrink > 1 else image), shrink


def _georeference(path: Path, tags: dict[int, Any]) -> tuple[Any, Any]:
    """Return from coordinates to columns and rows of a GeoTIFF, and its CRS."""
    if MATRIX_TAG in tags:
        a, b, _, x0, c, d, _, y0 = tags[MATRIX_TAG][:8]
        i0 = j0 = 0.0
    elif SCALE_TAG in tags and TIE_TAG in tags:
        i0, j0, _, x0, y0 = tags[TIE_TAG][:5]
        a, b, c, d = tags[SCALE_TAG][0], 0.0, 0.0, -tags[SCALE_TAG][1]
    else:
        raise InputError.in_file(
            path, f"is a picture that does not say where it lies (tag {SCALE_TAG}); {REWRITE}"
        )
    if a * d == b * c:
        raise ValueError("its pixels have no size")
    listed = tags.get(KEYS_TAG, ())
    keys = {listed[index]: listed[index + 3] for index in range(4, len(listed) - 3, 4)}
    code = next((keys[key] for key in CRS_KEYS if key in keys), USER_DEFINED)
    if code == USER_DEFINED:
        raise InputError.in_file(
            path, "names no CRS by its EPSG code; write it anew by gdalwarp -t_srs EPSG:3857"
        )
    # else its corner is at a whole number
    corner_offset = 0.5 if keys.get(RASTER_KEY) == RASTER_POINT else 0.0

    def to_pixel(x: Array, y: Array) -> tuple[Array, Array]:
        dx, dy, det = x - x0, y - y0, a * d - b * c
        return i0 + corner_offset + (d * dx - b * dy) / det, j0 + corner_offset + (
            a * dy - c * dx
        ) / det

    return to_pixel, crs_of(f"EPSG:{code}")


def _tiles(path: Path, net_of: Any) -> tuple[_Raster, Any]:
    """Return the tiles that the net covers, put together, and their CRS."""
    crs = crs_of("EPSG:3857")
    x, y = net_of(crs)
    with opened_database(path, ("map", "images"), f"{BACKGROUNDS}; {REWRITE}") as database:
        tables = dict(database.execute("SELECT name, type FROM sqlite_master"))
        source = "tiles" if tables.get("tiles") == "table" else "map JOIN images USING (tile_id)"
        levels = sorted(
            level for (level,) in database.execute(f"SELECT DISTINCT zoom_level FROM {source}")
        )
        levels = [level for level in levels if isinstance(level, int) and 0 <= level <= 30]
        if not levels:
            raise ValueError("it holds no tiles")

        def cover(level: int) -> tuple[int, int, int, int]:
            side, last_tile = 2.0 * MERCATOR_M / 2**level, 2**level - 1
            ends = (x.min(), y.min(), x.max(), y.max())
            return tuple(  # type: ignore[return-value]
                int(np.clip((end + MERCATOR_M) / side, 0, last_tile)) for end in ends
            )

        def count(level: int) -> int:
            west, south, east, north = cover(level)
            return (east - west + 1) * (north - south + 1)

        metres_of_pixel = float(np.ptp(x)) / PICTURE_WIDTH_PX
        sharp_enough = [
            candidate
            for candidate in levels
            if 2.0 * MERCATOR_M / (256 * 2**candidate) <= metres_of_pixel
        ]
        level = min(sharp_enough, default=levels[-1])
        while count(level) > MOST_TILES and level > levels[0]:
            level = max(candidate for candidate in levels if candidate < level)
        box = cover(level)
        rgba = _put_together(database, source, level, box)
    side = 2.0 * MERCATOR_M / 2**level
    pixel = rgba.shape[1] / (box[2] - box[0] + 1) / side  # pixels of a metre

    def columns_rows(x: Array, y: Array) -> tuple[Array, Array]:
        west, north = box[0] * side - MERCATOR_M, (box[3] + 1) * side - MERCATOR_M
        return (x - west) * pixel - 0.5, (north - y) * pixel - 0.5

    return _Raster(rgba, columns_rows), crs


def _put_together(
    database: sqlite3.Connection, source: str, level: int, box: tuple[int, int, int, int]
) -> Any:
    """Return the pixels (h, w, 4) of the tiles between columns and rows of a level."""
    from PIL import Image

    west, south, east, north = box
    query = (
        f"SELECT tile_column, tile_row, tile_data FROM {source} WHERE zoom_level = ? AND"
        " tile_column BETWEEN ? AND ? AND tile_row BETWEEN ? AND ?"
    )
    mosaic: Any = np.zeros((north - south + 1, east - west + 1, 1, 1, 4), dtype=np.uint8)
    for column, row, blob in database.execute(query, (level, west, east, south, north)):
        try:
            with Image.open(io.BytesIO(blob)) as image:
                side = image.width
                if image.height != side or not 1 <= side <= LARGEST_TILE_PX:
                    raise ValueError(f"a tile of {image.width} x {image.height} pixels")
                tile, _ = _reduce_resolution(image, 1.0)
        except (OSError, SyntaxError) as error:
            raise ValueError(f"tile {level}/{column}/{row} is no picture: {error}") from None
        if mosaic.shape[2] == 1:
            mosaic = np.zeros((*mosaic.shape[:2], side, side, 4), dtype=np.uint8)
        if tile.shape[:2] != mosaic.shape[2:4]:
            raise ValueError(f"tile {level}/{column}/{row} has another size than its neighbours")
        mosaic[north - row, column - west] = tile
    rows, columns, high, wide, bands = mosaic.shape
    return mosaic.swapaxes(1, 2).reshape(rows * high, columns * wide, bands)
