"""XMP packets: properties set in an old packet, whose others stay, or in a new one.

The packet is edited as text, since taking XML apart and writing it anew changes prefixes and order
that readers of images rely on; the result is parsed, and each property must stand in it once.
"""

import re
from collections.abc import Mapping
from xml.sax.saxutils import quoteattr

from ....base.errors import InputError
from ..text.xml import parse_xml

RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
EMPTY_PACKET = (
    '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>\n<x:xmpmeta'
    f' xmlns:x="adobe:ns:meta/">\n<rdf:RDF xmlns:rdf="{RDF}">\n</rdf:RDF>\n</x:xmpmeta>\n<?xpacket'
    ' end="w"?>'
)

Properties = Mapping[tuple[str, str], Mapping[str, str]]
"""By namespace (prefix, URI): simple values by name."""


def set_properties(
    packet: bytes | None, new: Properties, stale: Mapping[str, tuple[str, ...]], who: str
) -> bytes:
    """Return the packet with the `new` properties, and without those that `stale` names.

    Parameters
    ----------
    packet : bytes, optional
        The old packet.
    new : mapping
        Values by name, by namespace (prefix, URI).
    stale : mapping
        Names by the URI of their namespace.
    who : str
        The image, for messages.

    Raises
    ------
    InputError
        A packet that is no UTF-8 or not well formed.
    """
    try:
        text = EMPTY_PACKET if packet is None else packet.rstrip(b"\x00").decode("utf-8")
    except UnicodeDecodeError:
        raise _broken_xmp_error(who, "is no UTF-8") from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise _broken_xmp_error(who, "declares a document type")
    ours = [(prefix, uri, (*values, *stale.get(uri, ()))) for (prefix, uri), values in new.items()]
    for own_prefix, uri, names in [*ours, *((None, uri, names) for uri, names in stale.items())]:
        bound = set(re.findall(rf'xmlns:([\w.-]+)\s*=\s*["\']{re.escape(uri)}["\']', text))
        # ours as well where it stands for a sibling of the namespace
        for prefix in bound | ({own_prefix} if own_prefix else set()):
            text = _without_property(text, prefix, names)
    rdf = next(iter(re.findall(rf'xmlns:([\w.-]+)\s*=\s*["\']{re.escape(RDF)}["\']', text)), "rdf")
    about = re.search(rf'{rdf}:about\s*=\s*("[^"]*"|\'[^\']*\')', text)
    entry = f"<{rdf}:Description {rdf}:about={about[1] if about else quoteattr('')}"
    for (prefix, uri), values in new.items():
        entry += f"\n  xmlns:{prefix}={quoteattr(uri)}"
        entry += "".join(
            f"\n  {prefix}:{name}={quoteattr(value)}" for name, value in values.items()
        )
    text = re.sub(rf"<{rdf}:RDF([^>]*)/>", rf"<{rdf}:RDF\1></{rdf}:RDF>", text)
    beginning, end, closing = text.rpartition(f"</{rdf}:RDF>")
    text = f"{beginning}{entry}/>\n{end}{closing}"
    if not end or not _is_written_once(text, new, stale):
        raise _broken_xmp_error(who, "is not well formed")
    return text.encode("utf-8")


def _without_property(text: str, prefix: str, names: tuple[str, ...]) -> str:
    """Return `text` without attributes and elements of these names."""
    name = rf"{re.escape(prefix)}:(?:{'|'.join(map(re.escape, names))})"
    text = re.sub(rf"<({name})(?:\s[^<>]*)?(?:/>|>.*?</\1\s*>)\s*", "", text, flags=re.DOTALL)
    return re.sub(rf"\s+{name}\s*=\s*(?:\"[^\"]*\"|'[^']*')", "", text)


def _is_written_once(text: str, new: Properties, stale: Mapping[str, tuple[str, ...]]) -> bool:
    """Return whether the text is valid XML that holds each new property once."""
    try:
        root = parse_xml("", text.strip().encode("utf-8"))
    except InputError:
        return False
    count: dict[str, int] = {}
    for element in root.iter():
        for key in (element.tag, *element.attrib):
            count[str(key)] = count.get(str(key), 0) + 1
    ours = {f"{{{uri}}}{name}" for (_, uri), values in new.items() for name in values}
    stale_names = {f"{{{uri}}}{name}" for uri, names in stale.items() for name in names} - ours
    return all(count.get(key) == 1 for key in ours) and not stale_names & set(count)


def _broken_xmp_error(who: str, message: str) -> InputError:
    return InputError(
        f"{who}: its XMP packet {message}; remove the packet or copy the image again from its"
        " source"
    )
