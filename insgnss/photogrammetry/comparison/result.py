"""What a comparison says.

It has differences with statistics, and the mismatches that it recognised, each with its evidence.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ...base.files import pick_attributes
from ...records import Array
from ...report.document import Document, Section, Table
from ...report.notebook import Charted, Documented
from ...report.verdict import Verdict, worst_of

if TYPE_CHECKING:
    from ...report.charts.chart import Chart
    from ...report.charts.drawn import Form

Aspect = Literal["position", "time", "horizontal", "height", "attitude"]

SCREEN_UNITS = {"m": (1e3, "mm"), "rad": (float(np.degrees(1.0)), "deg"), "m/s": (1e3, "mm/s")}
DIGITS = {"mm": 2, "m": 3, "deg": 4, "mm/s": 2, "m/s": 3}
WIDE = 1.5  # rms over sigma from which on the standard deviations are doubted
UNTRANSFORMED = "compared without a transformation"  # what a note says of two datums
NO_MISMATCH = (
    "names, axes, angles, time, height and lever arm were compared: no mismatch recognised"
)
WIDE_PARAMETER = 3.5  # sigmas of one camera parameter: one of 2000 differs by more
LARGE = 10.0  # m or m/s, from which thousandths are not shown


@dataclass(frozen=True)
class Mismatch:
    """A mismatch of convention that explains a part of the differences.

    Parameters
    ----------
    name : short.
    statement : a sentence.
    aspect : of the differences.
    before, after : their root mean square without and with it taken off, in `unit`; of time it is
        that of the stamps of the same images, s, or of the horizontal differences less a shift and
        a lever arm, m; of position it is about their mean.
    values : what was estimated, SI, by name.
    alternatives : statements of other hypotheses that explain as much.
    """

    name: str
    statement: str
    aspect: Aspect
    before: float
    after: float
    values: dict[str, float] = field(default_factory=dict)
    alternatives: tuple[str, ...] = ()
    unit: str = "m"

    @property
    def explained(self) -> float:
        """Share of the mean square that it explains."""
        return 1.0 - (self.after / self.before) ** 2

    def sentence(self) -> str:
        """Statement and evidence."""
        before, after = quantity(self.before, self.unit), quantity(self.after, self.unit)
        of = (
            "position differences about their mean"
            if self.aspect == "position"
            else f"{self.aspect} differences"
        )
        if self.aspect == "time":
            of = (
                "differences of time"
                if self.unit == "s"
                else "horizontal differences that no shift or lever arm explains"
            )
        text = (
            f"{self.statement}: explains {percent(self.explained)} of the {of} (rms {before} ->"
            f" {after})"
        )
        return text + "".join(f"; or {alternative}" for alternative in self.alternatives)

    def as_dict(self) -> dict[str, Any]:
        """JSON-able, SI."""
        return {
            "part": self.aspect,
            "rms_before": self.before,
            "rms_after": self.after,
            **pick_attributes(
                self, "name", "statement", "unit", "explained", "values", "alternatives"
            ),
        }


@dataclass(frozen=True, eq=False)
class ComponentDifferences:
    """Differences b minus a of one component: (n,) m, rad or m/s.

    Sigma (n,) of them where both files, or one of them, have it.
    """

    name: str
    unit: str
    difference: Array
    sigma: Array | None = None

    @property
    def screen(self) -> tuple[float, str]:
        """Factor and unit in which people read it."""
        if self.unit != "rad" and float(np.abs(self.difference).max()) >= LARGE:
            return 1.0, self.unit
        return SCREEN_UNITS[self.unit]

    def shown(self, name: str) -> str:
        """Return one of the statistics in the unit in which people read it."""
        factor, unit = self.screen
        return f"{factor * self.statistics()[name]:.{DIGITS[unit]}f}"

    def statistics(self) -> dict[str, float]:
        """mean, median, sd, rms, p95 (of the magnitude), largest, in SI.

        normalised_rms where there are standard deviations.
        """
        d = self.difference
        size = np.abs(d)
        out = {
            "mean": float(d.mean()),
            "median": float(np.median(d)),
            "sd": float(d.std(ddof=1)) if d.size > 1 else 0.0,
            "rms": float(np.sqrt(np.mean(d**2))),
            "p95": float(np.quantile(size, 0.95)),
            "largest": float(size.max()),
        }
        if self.sigma is not None:
            out["normalised_rms"] = float(np.sqrt(np.mean((d / self.sigma) ** 2)))
        return out


@dataclass(frozen=True)
class ParameterDifference:
    """Difference b minus a of a camera parameter (px, or of the polynomial), and its sigma."""

    camera: str
    name: str
    difference: float
    sigma: float

    @property
    def ratio(self) -> float:
        """Difference over its standard deviation; zero where neither file estimates it."""
        return self.difference / self.sigma if self.sigma > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class AdjustedDifferences:
    """Object points and cameras of two adjustments, b minus a, in the axes of the block.

    Parameters
    ----------
    points : x, y, z of the points of one name; empty where a file lists none.
    parameters : of the cameras of one name.
    notes : what was left out.
    """

    points: tuple[ComponentDifferences, ...] = ()
    parameters: tuple[ParameterDifference, ...] = ()
    notes: tuple[str, ...] = ()

    def sections(self) -> tuple[Section, ...]:
        """Return tables of points and cameras; none without any."""
        rows = [
            (p.camera, p.name, f"{p.difference:.4g}", f"{p.sigma:.3g}", f"{p.ratio:.2f}")
            for p in self.parameters
        ]
        head = ("camera", "", "b minus a", "sigma", "over sigma")
        count = self.points[0].difference.size if self.points else 0
        return (
            Section(f"{count} object points, b minus a, axes of the block", _table(self.points)),
            Section("Interior orientation", [Table(rows, head, numbers=True)] if rows else []),
        )

    def as_dict(self) -> dict[str, Any]:
        """JSON-able, SI and px."""
        return {
            "points": {c.name: {"unit": c.unit, **c.statistics()} for c in self.points},
            "cameras": [
                pick_attributes(p, "camera", "name", "difference", "sigma") for p in self.parameters
            ],
        }


@dataclass(frozen=True, eq=False)
class Comparison(Charted, Documented):
    """Differences b minus a, in the axes east, north, up at a's points.

    Parameters
    ----------
    a, b : files, as they were called.
    form_a, form_b, point_a, point_b : formats, and what their positions are of.
    matched_by : "image" or "time".
    labels : images, or empty; time : (n,) s, or None.
    left_a, left_b : poses without partner.
    components : in the order of the tables.
    findings : in the order in which they were taken off.
    remaining : the components after it, at `remaining_time`: other poses where the clocks disagree.
    notes : what a reader should know.
    adjusted : of two adjustments, what their points and cameras differ in.
    """

    a: str
    b: str
    form_a: str
    form_b: str
    point_a: str
    point_b: str
    matched_by: str
    labels: tuple[str, ...]
    time: Array | None
    left_a: int
    left_b: int
    components: tuple[ComponentDifferences, ...]
    findings: tuple[Mismatch, ...] = ()
    remaining: tuple[ComponentDifferences, ...] = ()
    remaining_time: Array | None = None
    notes: tuple[str, ...] = ()
    adjusted: AdjustedDifferences = field(default_factory=AdjustedDifferences)

    @property
    def n(self) -> int:
        """Number of pairs."""
        return int(self.components[0].difference.size)

    def document(self, charts: "Sequence[Chart]" = ()) -> Document:
        """Return what differs by how much, what explains it, and what remains.

        Parameters
        ----------
        charts : those of `charts`, for the page.
        """
        sizes = ", ".join(f"{c.name} {c.shown('rms')} {c.screen[1]}" for c in self.components)
        files = [("a", self.a, self.form_a, self.point_a), ("b", self.b, self.form_b, self.point_b)]
        without = f"without partner: {self.left_a} of a, {self.left_b} of b"
        return Document(
            f"{Path(self.a).name} and {Path(self.b).name}: comparison",
            f"{self.n} poses matched by {self.matched_by}; rms of b minus a: {sizes}",
            self._verdict(),
            (
                Section("Recognised", [f.sentence() for f in self.findings] or [NO_MISMATCH]),
                *charts,
                Section("b minus a, axes east, north, up at the point", _table(self.components)),
                Section(
                    "What remains after the recognised differences are removed",
                    _table(self.remaining),
                ),
                *self.adjusted.sections(),
                Section(
                    "What was compared", [Table(files, ("", "file", "format", "positions of"))]
                ),
                Section("Notes", [without, *self.notes, *self.adjusted.notes]),
            ),
            [Path(self.a), Path(self.b)],
        )

    def _verdict(self) -> Verdict:
        """Return what the differences say of the two."""
        names = ", ".join(finding.name for finding in self.findings)
        ratios = [(c.name, c.statistics().get("normalised_rms", 0.0)) for c in self.components]
        points = self.adjusted.points
        ratios += [(f"points {c.name}", c.statistics()["normalised_rms"]) for c in points]
        parameters = [(f"{p.name} of {p.camera}", abs(p.ratio)) for p in self.adjusted.parameters]
        listed = [pair for pair in ratios if pair[1] > WIDE]
        listed += [pair for pair in parameters if pair[1] > WIDE_PARAMETER]
        wide = ", ".join(f"{name} {ratio:.1f}" for name, ratio in listed)
        mismatch = f"a mismatch of conventions explains a part of the differences: {names}"
        passes = f"up to {WIDE:g} passes"
        if parameters:
            passes += f", of one camera parameter up to {WIDE_PARAMETER:g}"
        larger = (
            f"differences are larger than their standard deviations say (rms over sigma {wide};"
            f" {passes})"
        )
        remarks = [mismatch] if names else [larger] if wide else []
        return worst_of(NO_MISMATCH, remarks + [n for n in self.notes if UNTRANSFORMED in n])

    def as_dict(self) -> dict[str, Any]:
        """JSON-able, SI."""
        return {
            **pick_attributes(
                self, "a", "b", "form_a", "form_b", "point_a", "point_b", "matched_by"
            ),
            "matched": self.n,
            "without_partner": {"a": self.left_a, "b": self.left_b},
            "components": {c.name: {"unit": c.unit, **c.statistics()} for c in self.components},
            "findings": [finding.as_dict() for finding in self.findings],
            "remaining": {c.name: {"unit": c.unit, **c.statistics()} for c in self.remaining},
            "notes": [*self.notes, *self.adjusted.notes],
            **self.adjusted.as_dict(),
        }

    def charts(self) -> "tuple[Chart, ...]":
        """Return the differences over time, or over the images, what remains, and distributions."""
        from ...report.figures.comparison import ComparisonPanel, Curve, comparison_charts

        def curve(c: ComponentDifferences) -> Curve:
            factor, unit = c.screen
            return Curve(factor * c.difference, None if c.sigma is None else factor * c.sigma, unit)

        after = {c.name: curve(c) for c in self.remaining}
        panels = [ComparisonPanel(c.name, curve(c), after.get(c.name)) for c in self.components]
        return comparison_charts(panels, (self.time, self.remaining_time), self.labels)

    def figure(self, form: "Form" = "png") -> bytes:
        """Draw all charts on one sheet.

        Parameters
        ----------
        form : "png", "pdf" or "svg".
        """
        from ...report.charts.drawn import draw_sheet

        first, *middle, distribution = self.charts()
        columns = [[first], middle] if middle else [[first, distribution]]
        title = f"{self.n} poses, b minus a" + "".join(f"; {f.name}" for f in self.findings)
        return draw_sheet(columns, title, f"a: {self.a}    b: {self.b}", form)


def _table(components: tuple[ComponentDifferences, ...]) -> list[Table]:
    """Return the statistics of components as a table; none without any."""
    normalised = ["rms/sigma"] if any(c.sigma is not None for c in components) else []
    head = ("", "mean", "median", "sd", "rms", "95 %", "largest", "unit", *normalised)
    names = ("mean", "median", "sd", "rms", "p95", "largest")
    rows = []
    for c in components:
        ratio = c.statistics().get("normalised_rms")
        last = ["–" if ratio is None else f"{ratio:.2f}"] if normalised else []
        rows.append((c.name, *map(c.shown, names), c.screen[1], *last))
    return [Table(rows, head, numbers=True)]


def quantity(value: float, unit: str) -> str:
    """A number with its unit, as people read it."""
    if unit == "rad":
        return f"{np.degrees(value):.4g} deg"
    if unit == "s":
        return f"{value:.6g} s"
    return f"{value:.4g} m" if value >= 1.0 else f"{1e3 * value:.3g} mm"


def percent(share: float) -> str:
    """A share; not rounded up to all of it."""
    if share >= 0.9999:
        return "more than 99.99 %" if share < 1.0 - 1e-9 else "all"
    return f"{100.0 * share:.2f} %" if share > 0.99 else f"{100.0 * share:.1f} %"
