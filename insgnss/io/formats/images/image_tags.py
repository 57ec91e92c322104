r"""Position and attitude in JPEG and TIFF copies: Exif and XMP tags, data_specs/image_tags.md.

Exif GPS has one pair of numbers for a height and two meanings. Up to Exif 2.32 GPSAltitudeRef 0 and
1 are above and below *sea level*; in Exif 3.0 they are above and below the *ellipsoid*, and 2 and 3
sea level. Heights above the ellipsoid therefore go with ExifVersion 0300; heights above sea level
with 0 and 1 where the image's Exif is older than 3.0, and with 2 and 3 where it is not.

    GPSTimeStamp, GPSDateStamp     UTC, that is GPST less the leap seconds
    GPSImgDirection                azimuth of the image's top from true north: of a camera pitched
                                   forward that of its view
    CameraElevationAngle           of the viewing direction above the horizon: -90 deg in the nadir
    Camera:Yaw Pitch Roll          of Pix4D: Rz(-yaw) Rx(pitch) Ry(roll) takes right, up, back into
                                   east, north, up
    drone-dji:Gimbal...            of DJI: north-east-down, Z-Y-X, of a camera that looks forward at
                                   zero

Angles of a DJI gimbal are those of `gimbal`.

Nothing is decoded: of a JPEG the segments of Exif and XMP are replaced, to a TIFF a directory is
appended (`tiff_tags`).
"""

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import BinaryIO, Literal

import numpy as np

from ....base import __version__
from ....base.errors import InputError, UsageError
from ....base.files import atomic_write
from ....base.inputs import open_bytes, readable
from ....geodesy.gpstime import calendar_from_gps
from ....records import Array, FramedOrientation
from ..orientation.exported import check_choice, frame_words, new_directory
from ..orientation.poses import local_sigma, sea_level, true_north_ypr
from ..text.text import Source
from .exif import EXIF_VERSION, camera_maker, exif_version, reader
from .exiftool import ARGUMENTS, CONFIG, arguments, config
from .gimbal import ANGLES_LEFT_OUT, GIMBALS, gimbal_angles
from .jpeg import with_tags
from .tiff_tags import ASCII, BYTE, RATIONAL, SRATIONAL, UNDEFINED, XMP, Tiff, Value
from .xmp import set_properties

SUFFIXES = (".jpg", ".jpeg", ".tif", ".tiff")
PIX4D, DJI, OWN_SPACE = (
    "http://pix4d.com/camera/1.0",
    "http://www.dji.com/drone-dji/1.0/",
    "urn:insgnss:exterior-orientation:1.0#",
)
STALE: dict[str, tuple[str, ...]] = {
    "http://ns.adobe.com/exif/1.0/": (
        *("GPSLatitude", "GPSLongitude", "GPSAltitude", "GPSAltitudeRef", "GPSTimeStamp"),
        *("GPSDateStamp", "GPSVersionID", "GPSImgDirection", "GPSImgDirectionRef"),
        *("GPSHPositioningError", "GPSMapDatum"),
    ),
    PIX4D: ("VertCS",),
    DJI: (
        *("AltitudeType", "GimbalYawDegree", "GimbalPitchDegree", "GimbalRollDegree"),
        *("GpsLatitude", "GpsLongitude", "GpsLongtitude", "AbsoluteAltitude", "RtkFlag"),
        *("RtkStdLon", "RtkStdLat", "RtkStdHgt", "RtkDiffAge"),
    ),
}
OF_DJI = ("dji", "hasselblad")  # makers, in lower case, whose pitch readers count from the horizon
TAG_ANGLES = ("Yaw", "Pitch", "Roll")
RTK = {0: "none", 16: "single", 34: "float", 50: "fix"}
COPIED_BYTES = 1 << 22  # bytes copied at a time: an image of any size takes 4 MB of memory


@dataclass(frozen=True, eq=False)
class Tags:
    """The tags of one image, in m and degrees.

    Attributes
    ----------
    place : sequence of float
        Latitude, longitude, height above sea level or the ellipsoid.
    sigma : sequence of float
        Standard deviations east, north, up.
    ypr, sigma_ypr : sequence of float
        Yaw, pitch, roll and their standard deviations.
    elevation : float
        Elevation of the viewing direction.
    gimbal : sequence of float, optional
        Yaw, pitch, roll of the gimbal.
    gimbal_words : str
        What the gimbal's angles mean.
    when : datetime
        The exposure, UTC.
    sea_level : bool
        Whether the height is above sea level.
    frame : str
        The frame and its heights in words.
    rtk_flag : int, optional
        RtkFlag of drone-dji.
    datum, datum_name : str
        Code and name of the geographic CRS of the place.
    """

    place: Sequence[float]
    sigma: Sequence[float]
    ypr: Sequence[float]
    sigma_ypr: Sequence[float]
    elevation: float
    gimbal: Sequence[float] | None
    gimbal_words: str
    when: datetime
    sea_level: bool
    frame: str
    rtk_flag: int | None
    datum: str
    datum_name: str

    @property
    def plan_sigma(self) -> float:
        """Root mean square of the two horizontal standard deviations."""
        return math.sqrt(0.5 * (self.sigma[0] ** 2 + self.sigma[1] ** 2))


def write_image_tags(
    eo: FramedOrientation,
    path: Source,
    images: Source | None = None,
    missing: Literal["refuse", "skip"] = "refuse",
    heights: Literal["ellipsoid", "sea level"] = "ellipsoid",
    undulation_m: float | Sequence[float] | Array | None = None,
    gimbal: Literal["auto", "none", "nadir", "exact"] = "auto",
    rtk_flag: int | None = None,
    form: Literal["copies", "exiftool"] = "copies",
) -> None:
    """Copy the images of the directory `images`, with their tags, into the directory `path`.

    `path` is made where it is missing.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation.
    path : path
        Directory of the copies.
    images : path
        Directory of the images.
    missing : {"refuse", "skip"}
        What to do about images without orientation and orientations without image.
    heights : {"ellipsoid", "sea level"}
        Heights of Exif and drone-dji.
    undulation_m : float or (n,), optional
        Geoid heights, m, for sea level.
    gimbal : {"auto", "none", "nadir", "exact"}
        Angles of a DJI gimbal, see `gimbal`; by default for cameras of DJI alone.
    rtk_flag : {0, 16, 34, 50}, optional
        RtkFlag of drone-dji.
    form : {"copies", "exiftool"}
        Copies, or arguments by which ExifTool tags the images themselves.

    Raises
    ------
    UsageError
        Wrong options, or a `path` that is `images` or holds other images.
    InputError
        Images that do not match or are none.
    DataError
        A camera that looks more than 45 deg off the nadir with gimbal "nadir".
    """
    source, directory = _directories(images, path)
    for name, value, accepted in (
        ("missing", missing, ("refuse", "skip")),
        ("gimbal", gimbal, GIMBALS),
        ("form", form, ("copies", "exiftool")),
    ):
        check_choice(name, value, accepted)
    if rtk_flag is not None and rtk_flag not in RTK:
        raise UsageError(
            f"rtk_flag {rtk_flag!r} is none of {', '.join(f'{k} ({v})' for k, v in RTK.items())}"
        )
    pairs = _pairs(eo, source, missing == "skip")
    tags = _tags(eo, _heights(eo, heights, undulation_m), heights == "sea level", gimbal, rtk_flag)
    with new_directory(
        directory,
        set() if form == "exiftool" else {file.name for _, file in pairs},
        lambda file: file.lower().endswith(SUFFIXES),
        "images",
    ) as into:
        if form == "exiftool":
            images_tags = [(file, _of_image(file, tags(k), gimbal == "auto")) for k, file in pairs]
            lines = (_arguments(file, values) for file, values in images_tags)
            atomic_write(into / ARGUMENTS, (line.encode() for line in lines))
            atomic_write(into / CONFIG, config(_properties(images_tags[0][1]), STALE))
            return
        for k, file in pairs:
            target = directory / file.name
            if target.exists() and target.samefile(file):
                raise UsageError(
                    f"{target}: is the image itself, which is not touched; give another directory"
                    " for the copies"
                )
            _write(file, into / file.name, _of_image(file, tags(k), gimbal == "auto"))


def _directories(images: Source | None, path: Source) -> tuple[Path, Path]:
    if images is None:
        raise UsageError(
            "image_tags writes into copies of images; give the directory where they are: --set"
            " images=DIR"
        )
    source, directory = Path(str(images)), Path(path)
    if not source.is_dir():
        raise UsageError(f"{source}: is no directory; give the one that holds the images")
    if directory.exists() and directory.samefile(source):
        raise UsageError(
            f"{directory}: holds the images themselves, which are not touched; give another"
            " directory for the copies"
        )
    return source, directory


def _heights(
    eo: FramedOrientation, heights: str, undulation_m: float | Sequence[float] | Array | None
) -> Array:
    if heights == "sea level":
        return sea_level(eo, undulation_m, "image_tags with heights above sea level")
    if heights != "ellipsoid" or undulation_m is not None:
        raise UsageError(
            f"heights {heights!r}: give 'ellipsoid', or 'sea level' and the geoid's heights"
            " (undulation_m)"
        )
    return eo.geodetic[:, 2]


def _pairs(eo: FramedOrientation, source: Path, skip: bool) -> list[tuple[int, Path]]:
    """Return rows and image files that belong together.

    They match by name, or by name without suffix where the orientation's has none.
    """
    files = {
        file.name: file
        for file in sorted(source.iterdir())
        if file.suffix.lower() in SUFFIXES and file.is_file()
    }
    stems: dict[str, list[Path]] = {}
    for file in files.values():
        stems.setdefault(file.stem, []).append(file)
    pairs, missing = [], []
    for k, name in enumerate(eo.images):
        bare = stems.get(name, []) if Path(name).suffix.lower() not in SUFFIXES else []
        matches = [files[name]] if name in files else bare
        if len(matches) > 1:
            raise InputError(
                f"{source}: {matches[0].name} and {matches[1].name} could both be image {name!r};"
                " give names with suffixes"
            )
        pairs += [(k, file) for file in matches]
        missing += [] if matches else [name]
    spare = sorted(set(files.values()) - {file for _, file in pairs})
    hint = "correct the names, or skip what does not match: --set missing=skip"
    if missing and not skip:
        raise InputError(
            f"{source}: has no image {missing[0]!r} ({len(missing)} of {len(eo.images)}"
            f" orientations lack their image); {hint}"
        )
    if spare and not skip:
        raise InputError(
            f"{source}: {spare[0].name} has no orientation ({len(spare)} of {len(files)} images"
            f" lack an orientation); {hint}"
        )
    if not pairs:
        raise InputError(
            f"{source}: none of its {len(files)} images is one of the {len(eo.images)}"
            " orientations; is it another flight?"
        )
    return pairs


def _tags(
    eo: FramedOrientation, height: Array, at_sea: bool, gimbal: str, rtk_flag: int | None
) -> Callable[[int], Tags]:
    """Return a function that makes the tags of a row."""
    ypr, sigma_ypr = true_north_ypr(eo)
    sigma = local_sigma(eo)
    gimbal_deg, gimbal_texts = gimbal_angles(eo, ypr[:, 0], gimbal)
    position = np.column_stack([np.degrees(eo.geodetic[:, :2]), height])
    elevation = np.degrees(np.arcsin(np.clip(eo.C_Ec[:, 2, 2], -1.0, 1.0)))

    def of(k: int) -> Tags:
        return Tags(
            place=position[k].tolist(),
            sigma=sigma[k].tolist(),
            ypr=np.degrees(ypr[k]).tolist(),
            sigma_ypr=np.degrees(sigma_ypr[k]).tolist(),
            elevation=float(elevation[k]),
            gimbal=None if gimbal_deg is None else gimbal_deg[k].tolist(),
            gimbal_words=gimbal_texts[k],
            when=calendar_from_gps(eo.gps_week, float(eo.time[k])),
            sea_level=at_sea,
            frame=frame_words(eo),
            rtk_flag=rtk_flag,
            datum=eo.frame.datum,
            datum_name=eo.frame.datum_name,
        )

    return of


def _of_image(source: Path, tags: Tags, of_dji_only: bool) -> Tags:
    """Return the tags of an image, without angles of a gimbal that its camera does not have."""
    with readable(source), open_bytes(source) as stream:
        if of_dji_only and camera_maker(stream, str(source)).lower() not in OF_DJI:
            return replace(tags, gimbal=None, gimbal_words=ANGLES_LEFT_OUT)
    return tags


def _arguments(source: Path, tags: Tags) -> str:
    """Return the lines by which ExifTool tags an image."""
    with readable(source), open_bytes(source) as stream:
        exif, gps = exif_tags(exif_version(stream, str(source)), tags)
    return arguments(source.name, {**exif, **gps}, _properties(tags), STALE)


def _write(source: Path, target: Path, tags: Tags) -> None:
    with readable(source), open_bytes(source) as stream:
        atomic_write(target, _tagged_copy(stream, os.fstat(stream.fileno()).st_size, source, tags))


def _tagged_copy(stream: BinaryIO, size: int, source: Path, tags: Tags) -> Iterator[bytes]:
    """Yield the bytes of the copy, JPEG or TIFF, with the new tags."""
    read = reader(stream)
    name = str(source)
    if read(0, 2) == b"\xff\xd8":
        beginning, content_start = with_tags(
            read,
            size,
            name,
            lambda exif: patched_exif(exif, tags, name),
            lambda xmp: packet(xmp, tags, name),
        )
        yield beginning
        yield from _remaining_bytes(stream, content_start)
        return
    if read(0, 2) not in (b"II", b"MM"):
        raise InputError.in_file(
            source, "is neither JPEG nor TIFF; convert it, or export a table instead"
        )
    tiff = Tiff(read, size, name)
    xmp = (BYTE, packet(tiff.bytes_of(tiff.first, XMP), tags, name))
    header, appended = tiff.changed(
        {XMP: xmp}, *exif_tags(tiff.bytes_of(tiff.exif, EXIF_VERSION), tags)
    )
    yield header
    yield from _remaining_bytes(stream, len(header))
    yield appended


def _remaining_bytes(stream: BinaryIO, offset: int) -> Iterator[bytes]:
    stream.seek(offset)
    while chunk := stream.read(COPIED_BYTES):
        yield chunk


def patched_exif(exif: bytes | None, tags: Tags, who: str) -> bytes:
    """Return the TIFF within a JPEG's Exif segment, or a new one, with the tags."""
    old = exif or b"II\x2a\x00\x00\x00\x00\x00"
    tiff = Tiff(lambda offset, length: old[offset : offset + length], len(old), who)
    header, tail = tiff.changed({}, *exif_tags(tiff.bytes_of(tiff.exif, EXIF_VERSION), tags))
    return header + old[len(header) :] + tail


def exif_tags(
    existing: bytes | None, tags: Tags
) -> tuple[Mapping[int, Value], Mapping[int, Value]]:
    """Return the tags of the Exif and of the GPS directory of an image of an `existing` version."""
    existing = existing or b""
    version = b"0300" if not tags.sea_level else existing if existing[:4].isdigit() else b"0232"
    third = version >= b"0300"
    lat, lon, height = tags.place
    reference = 2 * (tags.sea_level and third) + (height < 0.0)
    when = tags.when
    clock = [
        (when.hour, 1),
        (when.minute, 1),
        (when.second * 1_000_000 + when.microsecond, 1_000_000),
    ]
    exif: dict[int, Value] = {
        EXIF_VERSION: (UNDEFINED, version),
        0x9405: (SRATIONAL, [(round(tags.elevation * 1e6), 1_000_000)]),
    }
    gps: dict[int, Value] = {
        0: (BYTE, bytes((2, 4 if third else 3, 0, 0))),
        1: (ASCII, b"N\x00" if lat >= 0.0 else b"S\x00"),
        2: (RATIONAL, _sexagesimal(lat)),
        3: (ASCII, b"E\x00" if lon >= 0.0 else b"W\x00"),
        4: (RATIONAL, _sexagesimal(lon)),
        5: (BYTE, bytes((reference,))),
        6: (RATIONAL, [(round(abs(height) * 1e4), 10_000)]),
        7: (RATIONAL, clock),
        16: (ASCII, b"T\x00"),
        17: (RATIONAL, [(round(tags.ypr[0] * 1e6) % 360_000_000, 1_000_000)]),
        18: (
            ASCII,
            tags.datum_name.replace("WGS84", "WGS-84").encode("ascii", "replace") + b"\x00",
        ),
        29: (ASCII, when.strftime("%Y:%m:%d").encode() + b"\x00"),
        31: (RATIONAL, [(round(tags.plan_sigma * 1e5), 100_000)]),
    }
    return exif, gps


def _sexagesimal(degrees: float) -> list[tuple[int, int]]:
    """Return degrees, minutes, seconds to a millionth of a second, 0.03 mm."""
    minutes, microseconds = divmod(round(abs(degrees) * 3.6e9), 60_000_000)
    return [(minutes // 60, 1), (minutes % 60, 1), (microseconds, 1_000_000)]


def packet(xmp: bytes | None, tags: Tags, who: str) -> bytes:
    """Return the XMP packet with the tags."""
    return set_properties(xmp, _properties(tags), STALE, who)


def _properties(tags: Tags) -> dict[tuple[str, str], dict[str, str]]:
    """Return the XMP tags of Pix4D, DJI and our own by namespace."""
    heights = (
        "above mean sea level" if tags.sea_level else f"above the ellipsoid of {tags.datum_name}"
    )
    described = {
        "Software": f"insgnss {__version__}",
        "Frame": tags.frame,
        "Heights": heights,
        "GimbalAngles": tags.gimbal_words,
        "Position": "projection centre; lever arm and bore-sight applied",
    }
    lat, lon, height = tags.place
    east, north, up = tags.sigma
    camera = {name: f"{a:.6f}" for name, a in zip(TAG_ANGLES, tags.ypr, strict=True)}
    camera |= {
        f"IMU{name}Accuracy": f"{a:.6f}" for name, a in zip(TAG_ANGLES, tags.sigma_ypr, strict=True)
    }
    camera |= {
        "GPSXYAccuracy": f"{tags.plan_sigma:.5f}",
        "GPSZAccuracy": f"{up:.5f}",
        "HorizCS": "EPSG:4326" if tags.datum == "EPSG:4979" else tags.datum,
    }
    dji = {
        "GpsLatitude": f"{lat:+.10f}",
        "GpsLongitude": f"{lon:+.10f}",
        "GpsLongtitude": f"{lon:+.10f}",
        "AbsoluteAltitude": f"{height:+.4f}",
        "RtkStdLon": f"{east:.5f}",
        "RtkStdLat": f"{north:.5f}",
        "RtkStdHgt": f"{up:.5f}",
    }
    if tags.gimbal is not None:
        dji |= {
            f"Gimbal{name}Degree": f"{a:+.6f}"
            for name, a in zip(TAG_ANGLES, tags.gimbal, strict=True)
        }
    if tags.rtk_flag is not None:
        dji["RtkFlag"] = str(tags.rtk_flag)
    return {("Camera", PIX4D): camera, ("drone-dji", DJI): dji, ("insgnss", OWN_SPACE): described}
