"""Files of Metashape projects: XML, .psz, .psx with its folder, and PLY tables of tie points.

    .psz    a zip: doc.xml with everything, PLY tables beside it
    .psx    XML that names <project>.files/project.zip, whose doc.xml names <chunk>/chunk.zip,
            whose doc.xml names <frame>/frame.zip, whose doc.xml names point_cloud/point_cloud.zip
    .xml    cameras or markers exported

A path counts from the directory of the file that it stands in; of a PLY table, within its zip.
"""

import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TypeVar
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....base.files import lines_of
from ....base.unpacking import DAMAGED, check_unpacked
from ..text.layout import decode, quote
from ..text.numbers import whole
from ..text.text import Source, load_bytes
from ..text.xml import parse_xml, read_xml

Taken = TypeVar("Taken")

PROJECT_DOCUMENT = "doc.xml"
PROJECT = "{projectname}"
# numpy's names of PLY's types, which has them as well
_TYPES = {
    "char": "int8",
    "uchar": "uint8",
    "short": "int16",
    "ushort": "uint16",
    "int": "int32",
    "uint": "uint32",
    "float": "float32",
    "double": "float64",
}
_TYPES |= {name: name for name in _TYPES.values()}


@dataclass(frozen=True)
class ProjectFile:
    """The file that a document stands in.

    Parameters
    ----------
    path : Path
        The XML file, or the zip with it.
    zipped : bool
        Whether it is a zip.
    """

    path: Path
    zipped: bool

    def error(self, message: str, line: int | None = None) -> InputError:
        """Return the error `message` at this file."""
        return InputError.at_line(self.path, line, message)

    def member(self, name: str) -> bytes:
        """Return the bytes of a file beside the document.

        Parameters
        ----------
        name : str
            Its path.

        Returns
        -------
        bytes
            Its content.

        Raises
        ------
        InputError
            It is not there, or the zip is damaged.
        """
        if not self.zipped:
            return load_bytes(self.path.parent / name).tobytes()
        return self._unpacked(name, lambda stream, _: stream.read())

    def _unpacked(self, name: str, take: Callable[[IO[bytes], int], Taken]) -> Taken:
        """Return what is taken of the stream of a member, and of the size of the zip."""
        try:
            with zipfile.ZipFile(self.path) as archive:
                size = archive.getinfo(name).file_size
                check_unpacked(self.path, size, packed=archive.start_dir)
                with archive.open(name) as stream:
                    return take(stream, archive.start_dir)
        except KeyError:
            raise self.error(f"has no {name} inside; save the project again") from None
        except FileNotFoundError:
            raise self.error(
                "no such file; a project needs <name>.psx and, beside it, the folder <name>.files"
            ) from None
        except DAMAGED as error:
            raise self.error(f"is no readable zip archive: {error}; copy it again") from None

    def document(self) -> Element:
        """Return the root of the document.

        Returns
        -------
        Element
            The root.

        Raises
        ------
        InputError
            It is no XML, or more than a file of its size may hold.
        """
        if not self.zipped:
            return read_xml(self.path)
        return self._unpacked(
            PROJECT_DOCUMENT, lambda stream, size: parse_xml(self.path, stream, size)
        )

    def opened(self, element: Element) -> "tuple[Element, ProjectFile]":
        """Return what an element stands for: itself, or the document of the zip that it names.

        Parameters
        ----------
        element : Element
            The element, perhaps with an attribute path.

        Returns
        -------
        element : Element
            The content.
        source : ProjectFile
            The file that it stands in.
        """
        name = element.get("path", "").replace("\\", "/").replace(PROJECT, self.path.stem)
        if not name.endswith(".zip"):
            return element, self
        source = ProjectFile(self.path.parent / name, True)
        return source.document(), source


def opened_project(path: Source) -> tuple[Element, ProjectFile]:
    """Open a project or an exported XML file.

    Parameters
    ----------
    path : path
        .psz, .psx or .xml.

    Returns
    -------
    root : Element
        The document, or the chunk where the file holds one alone.
    source : ProjectFile
        The file that it stands in.

    Raises
    ------
    InputError
        It cannot be read, or is no such file.
    """
    path = Path(path)
    source = ProjectFile(path, load_bytes(path)[:4].tobytes() == b"PK\x03\x04")
    return source.opened(source.document())


def read_ply(source: ProjectFile, name: str, needed: tuple[str, ...]) -> NDArray[np.void]:
    """Read the vertices of a PLY table.

    Parameters
    ----------
    source : ProjectFile
        The file that names it.
    name : str
        Its path.
    needed : tuple of str
        Columns that it must have.

    Returns
    -------
    ndarray, (n,)
        Structured array of all columns.

    Raises
    ------
    InputError
        It is not binary little-endian PLY, lacks a column, or is cut off.
    """
    data = source.member(name)
    head, end, body = data.partition(b"end_header\n")
    rows = [line.split() for line in lines_of(decode(head))]
    form = next((line[1] for line in rows if line[:1] == ["format"] and len(line) > 1), "")
    elements = [line for line in rows if line[:1] == ["element"]]
    if not end or rows[:1] != [["ply"]] or form != "binary_little_endian" or not elements:
        raise source.error(f"{name}: is no binary little-endian PLY ({quote(form)}); save it again")
    columns = [line[1:] for line in rows if line[:1] == ["property"]]
    if len(elements) > 1 or any(len(c) != 2 or c[0] not in _TYPES for c in columns):
        raise source.error(f"{name}: holds more than a table of vertices; save the project again")
    if missing := [column for column in needed if column not in {c[1] for c in columns}]:
        raise source.error(f"{name}: has no column {missing[0]}; save the project again")
    kind = np.dtype([(column, _TYPES[of]) for of, column in columns]).newbyteorder("<")
    if "id" in needed and kind["id"].kind == "f":
        raise source.error(f"{name}: numbers of points are no integers; save the project again")
    n = whole(elements[0][2]) if elements[0][2:] else -1
    if n < 0 or len(body) < n * kind.itemsize:
        raise source.error(
            f"{name}: ends after {len(body) // kind.itemsize} of {n} rows; copy the project again"
        )
    return np.frombuffer(body, dtype=kind, count=n)
