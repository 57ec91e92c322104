"""Pictures of the ground below the map of a page: GeoTIFF and MBTiles, and what is refused."""

import io
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2
from pyproj import Transformer
from scipy.ndimage import binary_dilation, center_of_mass, label

from insgnss import InputError
from insgnss.geodesy.frames import LocalFrame
from insgnss.io.formats.gis.background import PICTURE_HEIGHT_PX, PICTURE_WIDTH_PX, read_background

LAT, LON, HEIGHT = 46.57, 6.54, 700.0
FRAME = LocalFrame(np.radians(LAT), np.radians(LON), 400.0)
# a flight of 4 km: corners of the block and its middle, deg
PLACES = [(46.556, 6.52), (46.556, 6.56), (46.584, 6.52), (46.584, 6.56), (46.57, 6.5401)]
FLIGHT = np.array([(*np.radians(place), HEIGHT) for place in PLACES])
MERCATOR = Transformer.from_crs(4326, 3857, always_xy=True)
SIDE_M = 2.0 * 20_037_508.342789244
PIXEL_M = 4.0  # of the GeoTIFF
WITHIN_PX = 0.1  # of the picture, whose pixels are about as large as those of the rasters
BLOB_PX = 9  # of a mark, square


def marked(size: tuple[int, int], centres: np.ndarray) -> np.ndarray:
    """A green picture (h, w, 3) with red squares about centres, columns and rows of its corner."""
    picture = np.zeros((*size[::-1], 3), dtype=np.uint8)
    picture[..., 1] = 120
    for column, row in centres:
        c, r = (round(x - BLOB_PX / 2) for x in (column, row))
        picture[r : r + BLOB_PX, c : c + BLOB_PX] = (255, 0, 0)
    return picture


def geotiff(
    path: Path, code: int = 25832, point: bool = False, matrix: bool = False, **more
) -> Path:
    """A GeoTIFF with marks at the pixels of the places, and where these are, deg."""
    projected = Transformer.from_crs(4326, code, always_xy=True)
    x, y = projected.transform(*np.array(PLACES).T[::-1])
    # marks are centred on pixels, whose corner is half a pixel away
    x0, y0 = np.floor(x.min()) - 1200.0, np.ceil(y.max()) + 1200.0
    size = [int((np.ptp(a) + 2400.0) / PIXEL_M) for a in (x, y)]
    centres = np.floor(np.stack([(x - x0), (y0 - y)], axis=1) / PIXEL_M) + 0.5
    tags = ImageFileDirectory_v2()
    shift = 0.5 * PIXEL_M if point else 0.0
    if matrix:
        tags[34264] = (
            PIXEL_M,
            0.0,
            0.0,
            x0 + shift,
            0.0,
            -PIXEL_M,
            0.0,
            y0 - shift,
            *[0.0] * 7,
            1.0,
        )
    else:
        tags[33550] = (PIXEL_M, PIXEL_M, 0.0)
        tags[33922] = (0.0, 0.0, 0.0, x0 + shift, y0 - shift, 0.0)
    tags.tagtype.update({34264: 12, 33550: 12, 33922: 12, 34735: 3})
    if code:
        keys = ((1024, 0, 1, 1), (1025, 0, 1, 2 if point else 1), (3072, 0, 1, code))
        tags[34735] = (1, 1, 0, len(keys), *(value for key in keys for value in key))
    for tag in more.get("without", ()):
        del tags[tag]
    image = Image.fromarray(marked(tuple(size), centres)).convert(more.get("mode", "RGB"))
    image.save(path, "TIFF", tiffinfo=tags)
    marks = projected.transform(*(PIXEL_M * centres * (1, -1) + (x0, y0)).T, direction="INVERSE")
    return path, np.stack(marks[::-1], axis=1)


def mbtiles(path: Path, level: int = 15, views: bool = False, **more) -> tuple[Path, np.ndarray]:
    """MBTiles of one level without the north-western tile, marked as the GeoTIFF is."""
    x, y = MERCATOR.transform(*np.array(PLACES).T[::-1])
    side = SIDE_M / 2**level
    ends = [int((a + 0.5 * SIDE_M) // side) for a in (x.min() - 1500, x.max() + 1500)]
    south, north = (int((a + 0.5 * SIDE_M) // side) for a in (y.min() - 1500, y.max() + 1500))
    shape = (256 * (ends[1] - ends[0] + 1), 256 * (north - south + 1))
    corner = ends[0] * side - 0.5 * SIDE_M, (north + 1) * side - 0.5 * SIDE_M
    centres = np.floor(np.stack([x - corner[0], corner[1] - y], axis=1) / (side / 256)) + 0.5
    whole = marked(shape, centres)
    marks = MERCATOR.transform(*(side / 256 * centres * (1, -1) + corner).T, direction="INVERSE")
    with sqlite3.connect(path) as database:
        columns = "zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER"
        if views:
            database.execute(f"CREATE TABLE map ({columns}, tile_id TEXT)")
            database.execute("CREATE TABLE images (tile_data BLOB, tile_id TEXT)")
            database.execute(
                "CREATE VIEW tiles AS SELECT zoom_level, tile_column, tile_row, tile_data"
                " FROM map JOIN images USING (tile_id)"
            )
        else:
            database.execute(f"CREATE TABLE tiles ({columns}, tile_data BLOB)")
        for column in range(ends[0], ends[1] + 1):
            for row in range(south, north + 1):
                if (column, row) == (ends[0], north):
                    continue
                r, c = 256 * (north - row), 256 * (column - ends[0])
                stream = io.BytesIO()
                Image.fromarray(whole[r : r + 256, c : c + 256]).save(stream, "PNG")
                blob, place = more.get("blob", stream.getvalue()), (level, column, row)
                if views:
                    database.execute("INSERT INTO map VALUES (?, ?, ?, ?)", (*place, str(place)))
                    database.execute("INSERT INTO images VALUES (?, ?)", (blob, str(place)))
                else:
                    database.execute("INSERT INTO tiles VALUES (?, ?, ?, ?)", (*place, blob))
    return path, np.stack(marks[::-1], axis=1)


def misplaced(path: Path, marks: np.ndarray) -> float:
    """Largest distance of a mark from where it is in the map, in pixels of the picture."""
    picture = read_background(path, FRAME, FLIGHT)
    red = (picture.pixels[..., 0] > 128) & (picture.pixels[..., 1] < 100)
    labels, count = label(binary_dilation(red, iterations=3))
    weights = picture.pixels[..., 0] / 255.0 * (picture.pixels[..., 1] < 121)
    assert count == len(PLACES)
    centres = np.array(center_of_mass(weights, labels, range(1, count + 1))) + 0.5
    west, south, east, north = picture.edges
    scale = np.array([PICTURE_HEIGHT_PX / (north - south), PICTURE_WIDTH_PX / (east - west)])
    position = FRAME.position_from_geodetic(*np.radians(marks).T, HEIGHT)
    wanted = np.stack([north - position[:, 0], position[:, 1] - west], axis=1) * scale
    return max(min(np.linalg.norm(w - c) for c in centres) for w in wanted)


@pytest.mark.slow
@pytest.mark.parametrize(
    "made", [{}, {"point": True}, {"matrix": True}, {"code": 2056}, {"mode": "P"}], ids=str
)
def test_a_geotiff_lies_where_its_tags_say(tmp_path, made) -> None:
    """Oracle: ECEF coordinates of the places; marks lie within a tenth of a pixel of them."""
    assert misplaced(*geotiff(tmp_path / "ground.tif", **made)) < WITHIN_PX


@pytest.mark.slow
@pytest.mark.parametrize(("level", "views"), [(15, False), (14, True)])
def test_tiles_lie_where_their_rows_and_columns_say(tmp_path, level, views) -> None:
    """Oracle: ECEF coordinates of the places; what has no tile is white."""
    path, marks = mbtiles(tmp_path / "g.mbtiles", level, views)
    assert misplaced(path, marks) < WITHIN_PX
    assert (read_background(path, FRAME, FLIGHT).pixels[0, 0] == 255).all()


def test_the_height_of_the_flight_decides_where_the_picture_lies() -> None:
    """Oracle: the plumb line through a place 3 km from the origin leans by 3 km / R."""
    low, high = (
        FRAME.position_from_geodetic(np.radians(46.597), np.radians(LON), h)
        for h in (400.0, 4400.0)
    )
    assert high[0] - low[0] == pytest.approx(4000.0 * low[0] / 6.37e6, rel=0.01)


@pytest.mark.parametrize(
    ("make", "problem"),
    [
        (lambda p: geotiff(p, without=(34735,))[0], "names no CRS by its EPSG code"),
        (lambda p: geotiff(p, without=(33550,))[0], "does not say where it lies"),
        (lambda p: geotiff(p, mode="F")[0], "mode F"),
        (lambda p: mbtiles(p, blob=b"\x1f\x8bvector")[0], "is no picture"),
        (lambda p: p.write_bytes(b"II*\0broken") and p, "is no GeoTIFF"),
        (lambda p: Image.new("RGB", (9, 9)).save(p, "PNG") or p, "it is PNG"),
        (lambda p: p, "cannot be read"),
    ],
    ids=["crs", "place", "bands", "vector", "broken", "png", "missing"],
)
def test_what_is_no_picture_of_the_ground_is_refused_in_one_line(tmp_path, make, problem) -> None:
    """Oracle: the fault that was planted."""
    path = make(tmp_path / "ground")
    with pytest.raises(InputError, match=problem) as refusal:
        read_background(path, FRAME, FLIGHT)
    assert str(path) in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.slow
def test_a_picture_of_another_place_is_refused(tmp_path) -> None:
    """Oracle: a flight 1 deg further north."""
    north = FLIGHT + [np.radians(1.0), 0.0, 0.0]
    frame = LocalFrame(np.radians(LAT + 1.0), np.radians(LON), 400.0)
    for path, _ in (geotiff(tmp_path / "ground.tif"), mbtiles(tmp_path / "ground.mbtiles")):
        with pytest.raises(InputError, match=r"nothing of the flight.*47\.5\d* to 47\.\d*"):
            read_background(path, frame, north)
