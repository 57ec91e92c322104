"""Rules on where the result is least accurate: a line, an image, an outage, a gap.

Each is judged against the rest of the same flight.
"""

import itertools
import statistics
from collections.abc import Callable, Iterator, Sequence

from ...base.findings import Finding, ranked
from ...records.verdicts import REMARK
from .wording import Figures, at_time, degrees, image_range, millimetres, no_fix, span, tilt

# of a sigma over the median
FIRST_IMAGE_RATIO, LINE_RATIO, WORST_IMAGE_RATIO, OUTAGE_RATIO = 1.5, 1.5, 3.0, 2.0
FEWEST_LINES = 3  # that have a median to be compared with
TURN_DEG = 60.0  # heading range that counts as a turn
LONG_IMU_GAP_S = 0.2  # bridged by a straight line: vibration and turns are lost (chosen)


def attitude(f: Figures) -> Iterator[Finding]:
    """Yield the line, and else the first image, whose heading or tilt is least accurate.

    What was flown before it is the reason given.
    """
    for name in ("heading", "tilt"):
        line = _weakest(f, f"{name}_deg")
        if line is not None and _ratio(f, line, f"{name}_deg") > 1.0:
            yield from _on_line(f, line, name, f"{name}_deg", degrees)
        else:
            yield from _first_image(f, name)


def position(f: Figures) -> Iterator[Finding]:
    """Yield the line of the least accurate position, but for an outage, which has its own rule."""
    line = _weakest(f, "horizontal_mm")
    if line is not None and _ratio(f, line, "horizontal_mm") > 1.0 and _outage_on(f, line) is None:
        yield from _on_line(f, line, "horizontal", "horizontal_mm", millimetres)


def _weakest(f: Figures, key: str) -> Figures | None:
    """The line with the largest of that sigma, where there are enough to compare."""
    lines: Sequence[Figures] = f["lines"]
    return max(lines, key=lambda line: float(line[key])) if len(lines) >= FEWEST_LINES else None


def _ratio(f: Figures, line: Figures, key: str) -> float:
    """Sigma of a line over the median of all lines and LINE_RATIO."""
    median = statistics.median(each[key] for each in f["lines"])
    return float(line[key]) / median / LINE_RATIO if median > 0.0 else 0.0


def _on_line(
    f: Figures, line: Figures, name: str, key: str, form: Callable[[float], str]
) -> Iterator[Finding]:
    median = statistics.median(each[key] for each in f["lines"])
    images = f", {image_range(line)}" if line["images"] else ""
    where = f"line {line['line']} ({span(f, line['start_s'], line['end_s'])}{images})"
    reason, help_ = why(f, line)
    text = (
        f"{'position' if name == 'horizontal' else name} is known to {form(line[key])} on {where},"
        f" to {form(median)} in the median of the lines: {reason}"
    )
    yield ranked(name, _ratio(f, line, key), text, help_)


def why(f: Figures, line: Figures) -> tuple[str, str]:
    """Why a line is weak, and what would help."""
    outage = _outage_on(f, line)
    if outage is not None:
        return no_fix(f, outage), "repeat the line"
    if line["turned_before_deg"] < TURN_DEG:
        return (
            "no turn came before it",
            f"make a turn or a figure of eight before line {line['line']}",
        )
    if line["turned_after_deg"] < TURN_DEG:
        return "no turn followed it", f"make a turn or a figure of eight after line {line['line']}"
    return slow_turns(line["turned_before_deg"]), "make faster turns close to the line"


def slow_turns(turned_deg: float) -> str:
    """Say that turns before a line or image did not help."""
    return f"the turns before ({turned_deg:.0f} deg of heading) are too slow or too long ago"


def _outage_on(f: Figures, line: Figures) -> Figures | None:
    """The longest outage that overlaps a line."""
    overlapping = [
        o
        for o in f["outages"]
        if o["time_s"] < line["end_s"] and o["time_s"] + o["length_s"] > line["start_s"]
    ]
    return max(overlapping, key=lambda o: float(o["length_s"]), default=None)


def _first_image(f: Figures, name: str) -> Iterator[Finding]:
    e = f["exposures"]
    if e is None:
        return
    first, median = e["attitude_deg"]["first"], e["attitude_deg"]["median"]
    sigma, usual = (first[2], median[2]) if name == "heading" else (tilt(first), tilt(median))
    if sigma <= FIRST_IMAGE_RATIO * usual:
        return
    why, help_ = why_first(f, name)
    text = (
        f"{name} is known to {degrees(sigma)} at the first image, to {degrees(usual)} in the"
        f" median: {why}"
    )
    yield ranked(name, sigma / usual / FIRST_IMAGE_RATIO, text, help_)


def why_first(f: Figures, name: str) -> tuple[str, str]:
    """Why heading or tilt of the first image is weak, and what would help."""
    turn = f["exposures"]["heading_range_before_first_deg"]
    why = slow_turns(turn)
    if name == "tilt":
        why = "too little was flown before it"
    elif turn < TURN_DEG:
        why = "no turn came before it"
    return why, "make a turn or a figure of eight before the first line"


def worst_image(f: Figures) -> Iterator[Finding]:
    """Yield an image that is much less accurate than the others, but for the first."""
    e = f["exposures"]
    if e is None:
        return
    for name, form, key in (
        ("position", millimetres, "position_mm"),
        ("attitude", degrees, "attitude_deg"),
    ):
        worst, median = e[key]["worst"], e[key]["median"]
        ratio = max(worst["sigma"]) / max(median)
        if ratio > WORST_IMAGE_RATIO and worst["image"] != e["first_image"]:
            if name == "attitude":
                name = "heading" if worst["sigma"][2] > tilt(worst["sigma"]) else "tilt"
            text = (
                f"the {name} of image {worst['image']} at {at_time(f, worst['time_s'])} is known to"
                f" {form(max(worst['sigma']))}, {ratio:.1f} times the median"
            )
            yield ranked(
                "image",
                ratio / WORST_IMAGE_RATIO,
                text,
                "weigh it by its covariance in the adjustment",
            )


def outage(f: Figures) -> Iterator[Finding]:
    """Yield the outage in which the sigmas grow most, and the number of the others."""
    if not f["outages"] or f["standing"]:
        return
    worst = max(f["outages"], key=lambda o: (float(o["horizontal_mm"]), float(o["length_s"])))
    median = max(f["trajectory"]["position_mm"]["median"][:2])
    grown = (
        f"positions are known to {millimetres(worst['horizontal_mm'])} horizontally and"
        f" {millimetres(worst['down_mm'])} in height there"
    )
    text = no_fix(f, worst)
    if worst["rejected"]:
        text += f" ({worst['rejected']} were rejected)"
    if worst["images"]:
        text += f", {image_range(worst)} in it"
    elif f["exposures"]:
        text += ", and no image was taken in it"
    further = len(f["outages"]) - 1
    more = f"; {further} more such {'time' if further == 1 else 'times'}" if further else ""
    rank = max(1.0, worst["horizontal_mm"] / 2**0.5 / median / OUTAGE_RATIO)
    help_ = "turn on both sides of an outage" if worst["length_s"] > 10.0 else ""
    yield ranked("outage", rank, f"{text}: {grown}{more}", help_)


def segments(f: Figures) -> Iterator[Finding]:
    """Yield the segments that were solved by themselves."""
    spans = f["segments"]
    if len(spans) > 1:
        missing_s = sum(after[0] - before[1] for before, after in itertools.pairwise(spans))
        text = (
            f"the flight falls into {len(spans)} segments that are solved one by one, and for"
            f" {missing_s:.0f} s between them no image is oriented"
        )
        yield ranked("segments", float(len(spans)), text, "find why the IMU's recording breaks off")


def gaps(f: Figures) -> Iterator[Finding]:
    """Yield the missing samples of the IMU."""
    bridged = f["imu_gaps"]
    if bridged:
        longest = max(bridged, key=lambda gap: float(gap["length_s"]))
        counted = (
            "1 gap of the IMU was bridged,"
            if len(bridged) == 1
            else f"{len(bridged)} gaps of the IMU were bridged, the longest"
        )
        text = (
            f"{counted} of {longest['length_s']:.3f} s at {at_time(f, longest['time_s'])}; the"
            " sigmas of the images hold it"
        )
        help_ = "check the logger: each gap weakens the images after it"
        yield ranked("IMU gaps", max(REMARK, longest["length_s"] / LONG_IMU_GAP_S), text, help_)
