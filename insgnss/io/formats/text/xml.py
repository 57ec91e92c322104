"""XML of other programs: parsed piece by piece, within limits that hold for any file.

No project or packet needs a document type, so that entities, which a document could define to grow
without end or to read other files, never occur. A tree takes far more memory than its text: its
elements count as what the file unpacks to (`base.unpacking`).
"""

import io
import math
from typing import IO
from xml.etree.ElementTree import Element, ParseError, XMLParser
from xml.parsers import expat

from ....base.errors import InputError
from ....base.received.nesting import DEEPEST_NESTING
from ....base.unpacking import check_unpacked
from .text import Source, load_bytes

PARSED_AT_A_TIME = 1 << 20  # bytes parsed between two looks at the limits: 1 MB of memory
# or this part of those before: a mark that does not end is scanned anew with each piece
SHARE_BEFORE = 2
MARK_BYTES = 75  # of memory by "<": an element takes 150, with its name, an attribute and its end


class _Prolog:
    """What stands before the root: it is parsed apart, up to the root, and may declare no type."""

    def __init__(self) -> None:
        self._parser, self._ended = expat.ParserCreate(), False
        self.line = 0  # of a document type
        self._parser.StartElementHandler = self._root
        self._parser.StartDoctypeDeclHandler = self._declared

    def feed(self, piece: bytes) -> None:
        """Take the next bytes."""
        if not self._ended:
            try:
                self._parser.Parse(piece)
            except (expat.ExpatError, StopIteration):
                self._ended = True  # what is no XML the other parser says

    def _root(self, *_: object) -> None:
        raise StopIteration

    def _declared(self, *_: object) -> None:
        self.line = self._parser.CurrentLineNumber
        raise StopIteration


def read_xml(path: Source) -> Element:
    """Return the root of an XML file, as `parse_xml` does."""
    return parse_xml(path, load_bytes(path).tobytes())


def text_of(element: Element | None) -> str:
    """Return the text of an element, empty where it is missing."""
    return "" if element is None or element.text is None else element.text.strip()


def parse_xml(path: object, data: bytes | IO[bytes], packed: float = math.inf) -> Element:
    """Return the root of an XML document.

    Parameters
    ----------
    path
        The file, for messages.
    data : bytes or binary stream
        The document.
    packed : float
        Of a stream: the size of the file that it is unpacked from, bytes.

    Returns
    -------
    Element
        The root.

    Raises
    ------
    InputError
        It is no XML, declares a document type, has elements within each other more than 100 deep,
        or has more elements than a file of its size may have.
    DataError
        Its elements take more than memory holds.
    """
    if isinstance(data, bytes):
        packed, data = len(data), io.BytesIO(data)
    parser, prolog, size, marks = XMLParser(), _Prolog(), 0, 0
    try:
        while piece := data.read(max(PARSED_AT_A_TIME, size // SHARE_BEFORE)):
            prolog.feed(piece)
            if prolog.line:
                problem = "declares a document type, which no file of this kind needs"
                raise InputError.at_line(path, prolog.line, f"{problem}; export it again")
            size, marks = size + len(piece), marks + piece.count(b"<")
            check_unpacked(path, size + MARK_BYTES * marks, "at least ", packed)
            parser.feed(piece)
        root = parser.close()
    except ParseError as error:
        problem = f"is no XML: {error}; export it again"
        raise InputError.at_line(path, error.position[0], problem) from None
    except (ValueError, LookupError) as error:  # an encoding
        raise InputError.at_line(path, 1, f"is no XML: {error}; export it again") from None
    level = [root]
    for _ in range(DEEPEST_NESTING):
        level = [element for parent in level for element in parent]
    if level:
        problem = f"has elements nested more than {DEEPEST_NESTING} deep"
        raise InputError.in_file(path, f"{problem}; export it again")
    return root
