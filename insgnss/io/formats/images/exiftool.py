"""Arguments with which ExifTool writes the tags into the images, in place of copies.

`exiftool -config exiftool.config -@ exiftool.args`, started in the directory of the images, sets
the tags that a copy would have. The configuration declares the namespaces of XMP: ExifTool does not
know all of their names. A `#` lets ExifTool take a number as it stands.
"""

from collections.abc import Mapping

from ....base.errors import InputError
from .tiff_tags import ASCII, RATIONAL, SRATIONAL, UNDEFINED, Value
from .xmp import Properties

ARGUMENTS, CONFIG = "exiftool.args", "exiftool.config"
EXIFTOOL_NAMES = {
    0x9000: "ExifIFD:ExifVersion",
    0x9405: "ExifIFD:CameraElevationAngle#",
    0: "GPS:GPSVersionID#",
    1: "GPS:GPSLatitudeRef#",
    2: "GPS:GPSLatitude",
    3: "GPS:GPSLongitudeRef#",
    4: "GPS:GPSLongitude",
    5: "GPS:GPSAltitudeRef#",
    6: "GPS:GPSAltitude#",
    7: "GPS:GPSTimeStamp#",
    16: "GPS:GPSImgDirectionRef#",
    17: "GPS:GPSImgDirection#",
    18: "GPS:GPSMapDatum",
    29: "GPS:GPSDateStamp",
    31: "GPS:GPSHPositioningError#",
}
"""ExifTool's names of the numbers of Exif tags."""
OF_XMP = {"GPSTimeStamp": "GPSDateTime", "GPSDateStamp": "GPSDateTime"}
"""ExifTool's names of properties of the namespace exif, where they are others than its own."""


def arguments(
    name: str, exif: Mapping[int, Value], new: Properties, stale: Mapping[str, tuple[str, ...]]
) -> str:
    """Return the lines that tag one image.

    Parameters
    ----------
    name : str
        The image's file name.
    exif : mapping
        Tags of the Exif and the GPS directory, by number.
    new : mapping
        Properties of XMP by namespace (prefix, URI).
    stale : mapping
        Names to be removed, by the URI of their namespace.

    Raises
    ------
    InputError
        A name with a line break, which would end its argument.
    """
    if len(name.splitlines()) > 1:
        raise InputError(
            f"image {name!r}: the name has a line break, which ExifTool cannot take; rename the"
            " file"
        )
    old_exif = (old for uri, names in stale.items() if "/exif/" in uri for old in names)
    rows = [f"-XMP-exif:{OF_XMP.get(old, old)}=" for old in old_exif]
    for (prefix, uri), values in new.items():
        rows += [f"-XMP-{prefix}:{old}=" for old in stale.get(uri, ()) if old not in values]
        rows += [f"-XMP-{prefix}:{key}={value}" for key, value in values.items()]
    rows += [f"-{EXIFTOOL_NAMES[tag]}={_text(value)}" for tag, value in exif.items()]
    return "\n".join([*rows, "-charset", "filename=utf8", f"./{name}", "-execute\n"])


def _text(value: Value) -> str:
    """Return the value of an Exif tag as ExifTool takes it."""
    kind, content = value
    if kind in (RATIONAL, SRATIONAL):
        return " ".join(f"{over / under:.10f}" for over, under in content)
    if kind in (ASCII, UNDEFINED):
        return bytes(content).rstrip(b"\0").decode("ascii")
    return " ".join(map(str, content))


def config(new: Properties, stale: Mapping[str, tuple[str, ...]]) -> str:
    """Return the configuration that declares the properties of XMP, all of them as text.

    Parameters
    ----------
    new : mapping
        Properties by namespace (prefix, URI).
    stale : mapping
        Names to be removed, by the URI of their namespace.
    """
    tables, main = [], []
    for k, ((prefix, uri), values) in enumerate(new.items()):
        table = f"Image::ExifTool::UserDefined::Tags{k}"
        main.append(f"    '{prefix}' => {{ SubDirectory => {{ TagTable => '{table}' }} }},")
        names = "".join(f"  {key} => {{}},\n" for key in sorted({*values, *stale.get(uri, ())}))
        tables.append(
            f"%{table} = (\n  GROUPS => {{ 0 => 'XMP', 1 => 'XMP-{prefix}', 2 => 'Camera' }},\n"
            f"  NAMESPACE => {{ '{prefix}' => '{uri}' }},\n  WRITABLE => 'string',\n{names});\n"
        )
    header = "%Image::ExifTool::UserDefined = (\n  'Image::ExifTool::XMP::Main' => {\n"
    return header + "\n".join(main) + "\n  },\n);\n" + "".join(tables) + "1;\n"
