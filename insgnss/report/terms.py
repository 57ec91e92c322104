"""Terms of the trade on a page: the first of each leads to its sentence, which the page holds.

docs/glossary.md has the same terms with symbols and files, for readers of the code.
"""

import re
from collections.abc import Mapping

TERMS: Mapping[str, tuple[str, str]] = {
    "sigma": (
        "sigmas?|standard deviations?",
        "standard deviation: two of three errors are smaller, 19 of 20 below twice this value",
    ),
    "tilt": ("tilt", "rotation of an image about the horizontal axes; the larger sigma of the two"),
    "TOW": ("TOW", "time of week: seconds of GPS time since the midnight that begins Sunday"),
    "lever arm": ("lever arms?", "vector from the IMU to the antenna, in the axes of the IMU"),
    "bore-sight": (
        "bore-sights?",
        "rotation from the axes of the IMU as they were built to those that the mounting states",
    ),
    "innovation": (
        "innovations?",
        "GNSS position less its prediction by the IMU and the earlier positions",
    ),
    "NIS": (
        "NIS",
        "normalised innovation squared: the innovation squared over its covariance; one per degree"
        " of freedom in the mean where the sigmas are honest",
    ),
    "separation": (
        "separation",
        "the flight filtered backward minus the same forward; one sigma in the mean where both"
        " sigmas are honest",
    ),
    "PDOP": (
        "PDOP",
        "position dilution of precision: factor by which satellite geometry enlarges a range "
        "error; below 2 is good, beyond 4 poor",
    ),
    "fixed": (
        "fixed / float",
        "fixed: the integer ambiguities are resolved (centimetres); float: they are not"
        " (decimetres)",
    ),
    "bias": (
        "bias(?:es)?",
        "error of a gyro or accelerometer that changes slowly, new each time it is switched on",
    ),
    "time offset": (
        "time offset",
        "value added to the time stamps of the GNSS positions to bring them to the IMU's clock",
    ),
    "time-correlated": (
        "time-correlated",
        "errors that stay from one GNSS position to the next: averaging reduces them little",
    ),
    "smoothed": ("smoothed", "computed from the data before and after the instant"),
    "tangent plane": (
        "tangent plane",
        "axes east, north and up of one point of the ellipsoid, parallel to themselves everywhere",
    ),
    "undulation": ("undulation", "height of the geoid (sea level) above the ellipsoid"),
    "deflection of the vertical": (
        "deflection of the vertical",
        "angle between the plumb line and the normal of the ellipsoid",
    ),
    "phase centre": ("phase centre", "point of the antenna to which the GNSS positions belong"),
}
_FORMS = (rf"(?P<t{k}>\b(?:{form})\b)" for k, (form, _) in enumerate(TERMS.values()))
_ANY = re.compile("|".join(_FORMS))
_TAG = re.compile(r"(<[^>]*>)")
_KEPT = ("a", "abbr", "code", "h1", "h2", "h3", "summary", "script", "style", "nav")


class TermLinks:
    """The terms of a page, each linked where it first stands."""

    def __init__(self) -> None:
        self.linked: dict[str, str] = {}

    def within(self, html: str) -> str:
        """Return a piece of the page in which terms that are new are links."""
        out, kept = [], 0
        for piece in _TAG.split(html):
            if piece.startswith("<"):
                name = piece.strip("</>").partition(" ")[0]
                if name in _KEPT:
                    kept += -1 if piece.startswith("</") else 1
            elif not kept:
                piece = _ANY.sub(self._link, piece)
            out.append(piece)
        return "".join(out)

    def _link(self, match: re.Match[str]) -> str:
        number = int(str(match.lastgroup)[1:])
        term, (_, meaning) = [*TERMS.items()][number]
        if term in self.linked:
            return match.group()
        self.linked[term] = meaning
        return f'<a class="term" href="#{_anchor(term)}" title="{meaning}">{match.group()}</a>'

    def rows(self) -> list[tuple[str, str, str]]:
        """Return the terms that were linked, by name: id, term and meaning."""
        by_name = sorted(self.linked.items(), key=lambda pair: pair[0].lower())
        return [(_anchor(term), term, meaning) for term, meaning in by_name]


def _anchor(term: str) -> str:
    return f"term-{term.replace(' ', '-')}"
