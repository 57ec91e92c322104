r"""KML for Google Earth and other globes: images with cameras, and the track, data_specs/kml.md.

`altitudeMode` absolute means above mean sea level, for which the geoid's heights N are needed: H =
h - N. Without them altitudes may be relative to the ground, whose height above the ellipsoid the
caller knows (relativeToGround: the globe counts from its own terrain), or left out (clampToGround:
the track lies on the terrain, and there are no cameras).

A KML camera looks along its -Z with Y up in the picture and X to the right, the axes right, up,
back of photogrammetry, and is turned by heading (clockwise from north) about Z, tilt about X, roll
about Z again:

    R = Rz(-heading) Rx(tilt) Rz(roll)                                                         (K.1)

so that heading is the azimuth of the viewing direction and tilt its angle from the nadir. In the
nadir (tilt below `NADIR_SINE`) the two turns about Z are one: heading is the azimuth of the
image's top
there, roll 0. Near it heading and roll are large and nearly opposite, which is exact all the same;
yaw, pitch, roll of the image's top stand beside them as data.
"""

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from ....base.errors import InputError, UsageError
from ....base.files import atomic_write
from ....geodesy.rotation import CV_RUB
from ....records import Array, FramedOrientation
from ..orientation.exported import check_characters, check_choice, xml_text
from ..orientation.poses import local_sigma, sea_level, sentences, true_north_ypr, utc
from ..text.text import Source

# sine of the tilt below which a view counts as vertical: rounding of the attitude's matrix
NADIR_SINE = 1e-9
CLAMPED = "clampToGround"


ALTITUDE_MODES = {  # KML's name of what altitudes count from, and ours
    "absolute": ("absolute", "above mean sea level"),
    "relative": ("relativeToGround", "above the ground"),
    "clamped": (CLAMPED, "none, the track lies on the ground"),
}
KML_DATA = (
    "yaw_deg",
    "pitch_deg",
    "roll_deg",
    "sigma_east_m",
    "sigma_north_m",
    "sigma_up_m",
    "ellipsoidal_height_m",
)


def write_kml(
    eo: FramedOrientation,
    path: Source,
    undulation_m: float | Sequence[float] | Array | None = None,
    altitude: Literal["absolute", "relative", "clamped"] = "absolute",
    ground_m: float | None = None,
) -> None:
    """Write degrees with 10 decimals (position) and 6 (angles), metres with 4, in any frame.

    KML's own frame is WGS84.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation.
    path : path
        The file.
    undulation_m : float or (n,)
        Heights of the geoid above the ellipsoid at the images, or one for all, m; of absolute
        altitudes.
    altitude : {"absolute", "relative", "clamped"}
        Above mean sea level, above the ground, or none.
    ground_m : float
        Height of the ground above the ellipsoid of WGS84, m; of relative altitudes.

    Raises
    ------
    UsageError
        `undulation_m` of absolute or `ground_m` of relative altitudes is missing, or one of them is
        given with others; another word for `altitude`.
    InputError
        `undulation_m` is no height of a geoid, or the ground is not below the images.
    """
    check_choice("kml: altitude", altitude, ALTITUDE_MODES)
    if altitude != "absolute" and undulation_m is not None:
        raise UsageError(f"kml: {altitude} altitudes need no geoid; leave it out")
    if (ground_m is not None) != (altitude == "relative"):
        raise UsageError(
            "kml: ground_m, the height of the ground above the ellipsoid, belongs to relative"
            " altitudes; give both, such as --set altitude=relative --set ground_m=512.3, or none"
        )
    height = eo.geodetic[:, 2]
    if altitude == "absolute":
        height = sea_level(eo, undulation_m, "kml")
    elif ground_m is not None:
        height = _above_ground(height, ground_m)
    elif altitude == "clamped":
        height = np.zeros(len(eo.images))
    position = np.column_stack([np.degrees(eo.geodetic[:, [1, 0]]), height])
    check_characters(eo.images)
    atomic_write(path, _document(eo, position, *ALTITUDE_MODES[altitude]))


def _above_ground(height: Array, ground_m: float) -> Array:
    """Return heights (n,) above a ground that lies below all of them."""
    above = height - ground_m
    if not (above > 0.0).all():
        raise InputError(
            f"kml: ground_m {ground_m:g} m is not below the images, the lowest of which is"
            f" {height.min():.1f} m above the ellipsoid; give the height of the ground above the"
            " ellipsoid of WGS84"
        )
    return above


def camera_angles(R: Array) -> Array:
    """Return heading (0 to 2 pi), tilt (0 to pi), roll (n, 3), rad, of a KML camera (K.1).

    Parameters
    ----------
    R : ndarray
        (n, 3, 3) rotations of right, up, back into east, north, up.
    """
    across = np.hypot(R[:, 0, 2], R[:, 1, 2])
    flat = across < NADIR_SINE
    heading = np.where(
        flat, np.arctan2(R[:, 0, 1], R[:, 1, 1]), np.arctan2(-R[:, 0, 2], -R[:, 1, 2])
    )
    roll = np.where(flat, 0.0, np.arctan2(R[:, 2, 0], R[:, 2, 1]))
    return np.column_stack([heading % (2.0 * np.pi), np.arctan2(across, R[:, 2, 2]), roll])


def _document(eo: FramedOrientation, position: Array, mode: str, meaning: str) -> Iterator[str]:
    description = xml_text("\n".join(sentences(eo, f"altitudes: {meaning}")))
    yield (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml'
        ' xmlns="http://www.opengis.net/kml/2.2">\n<Document>\n'
    )
    yield f"<name>exterior orientation</name>\n<description>{description}</description>\n"
    yield '<Style id="photo"><IconStyle><scale>0.6</scale><Icon>'
    yield "<href>http://maps.google.com/mapfiles/kml/shapes/camera.png</href></Icon>"
    yield "</IconStyle><LabelStyle><scale>0</scale></LabelStyle></Style>\n"
    if len(position) > 1:
        line = " ".join(f"{x:.10f},{y:.10f},{z:.4f}" for x, y, z in position.tolist())
        tessellated = "<tessellate>1</tessellate>" if mode == CLAMPED else ""
        yield f"<Placemark><name>track</name><LineString>{tessellated}"
        yield f"<altitudeMode>{mode}</altitudeMode>"
        yield f"<coordinates>{line}</coordinates></LineString></Placemark>\n"
    yield "<Folder><name>images</name>\n"
    yield from _placemarks(eo, position, mode)
    yield "</Folder>\n</Document>\n</kml>\n"


def _placemarks(eo: FramedOrientation, position: Array, mode: str) -> Iterator[str]:
    """Yield the placemark of each image, with a camera unless it is clamped to the ground."""
    camera = "<Camera><longitude>%.10f</longitude><latitude>%.10f</latitude>"
    camera += "<altitude>%.4f</altitude><heading>%.6f</heading>"
    camera += "<tilt>%.6f</tilt><roll>%.6f</roll>"
    camera += f"<altitudeMode>{mode}</altitudeMode></Camera>"
    if mode == CLAMPED:  # a camera on the ground would show nothing
        camera = ""
    data = "".join(f'<Data name="{name}"><value>%.6f</value></Data>' for name in KML_DATA)
    point = f"<Point><altitudeMode>{mode}</altitudeMode>"
    point += "<coordinates>%.10f,%.10f,%.4f</coordinates></Point>"
    template = f"<Placemark><name>%s</name>{camera}<TimeStamp><when>%s</when></TimeStamp>"
    template += "<styleUrl>#photo</styleUrl>"
    template += f"<ExtendedData>{data}</ExtendedData>{point}</Placemark>\n"
    ypr, _ = true_north_ypr(eo)
    angles = np.degrees(camera_angles(eo.C_Ec @ CV_RUB))
    table = np.column_stack([np.degrees(ypr), local_sigma(eo), eo.geodetic[:, 2]])
    rows = zip(eo.images, position.tolist(), angles.tolist(), utc(eo), table.tolist(), strict=True)
    for name, coordinates, camera_ypr, when, row in rows:
        view = (*coordinates, *camera_ypr) if camera else ()
        yield template % (xml_text(name), *view, when, *row, *coordinates)
