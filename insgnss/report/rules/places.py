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


def attitude(figures: Figures) -> Iterator[Finding]:
    """Yield the line, and else the first image, whose heading or tilt is least accurate.

    What was flown before it is the reason given.
    """
    for name in ("heading", "tilt"):
        line = _weakest(figures, f"{name}_deg")
        if line is not None and _ratio(figures, line, f"{name}_deg") > 1.0:
            yield from _on_line(figures, line, name, f"{name}_deg", degrees)
        else:
            yield from _first_image(figures, name)


def position(figures: Figures) -> Iterator[Finding]:
    """Yield the line of the least accurate position, but for an outage, which has its own rule."""
    line = _weakest(figures, "horizontal_mm")
    if (
        line is not None
        and _ratio(figures, line, "horizontal_mm") > 1.0
        and _outage_on(figures, line) is None
    ):
        yield from _on_line(figures, line, "horizontal", "horizontal_mm", millimetres)


def _weakest(figures: Figures, key: str) -> Figures | None:
    """The line with the largest of that sigma, where there are enough to compare."""
    lines: Sequence[Figures] = figures["lines"]
    return max(lines, key=lambda line: float(line[key])) if len(lines) >= FEWEST_LINES else None


def _ratio(figures: Figures, line: Figures, key: str) -> float:
    """Sigma of a line over the median of all lines and LINE_RATIO."""
    median = statistics.median(each[key] for each in figures["lines"])
    return float(line[key]) / median / LINE_RATIO if median > 0.0 else 0.0


def _on_line(
    figures: Figures, line: Figures, name: str, key: str, in_unit: Callable[[float], str]
) -> Iterator[Finding]:
    """Yield the finding that `name` is known worse on this line than on most lines."""
    median = statistics.median(other_line[key] for other_line in figures["lines"])
    images = f", {image_range(line)}" if line["images"] else ""
    where = f"line {line['line']} ({span(figures, line['start_s'], line['end_s'])}{images})"
    reason, help_ = why(figures, line)
    text = (
        f"{'position' if name == 'horizontal' else name} is known to {in_unit(line[key])} on"
        f" {where}, to {in_unit(median)} in the median of the lines: {reason}"
    )
    yield ranked(name, _ratio(figures, line, key), text, help_)


def why(figures: Figures, line: Figures) -> tuple[str, str]:
    """Why a line is weak, and what would help."""
    outage = _outage_on(figures, line)
    if outage is not None:
        return no_fix(figures, outage), "repeat the line"
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
    return f"the turns before it ({turned_deg:.0f} deg of heading) were too slow or too early"


def _outage_on(figures: Figures, line: Figures) -> Figures | None:
    """The longest outage that overlaps a line."""
    overlapping = [
        o
        for o in figures["outages"]
        if o["time_s"] < line["end_s"] and o["time_s"] + o["length_s"] > line["start_s"]
    ]
    return max(overlapping, key=lambda o: float(o["length_s"]), default=None)


def _first_image(figures: Figures, name: str) -> Iterator[Finding]:
    """Yield the finding that the first image's `name`, tilt or heading, is less accurate."""
    exposures = figures["exposures"]
    if exposures is None:
        return
    sigma_of_first, median = exposures["attitude_deg"]["first"], exposures["attitude_deg"]["median"]
    sigma, usual = (
        (sigma_of_first[2], median[2])
        if name == "heading"
        else (tilt(sigma_of_first), tilt(median))
    )
    if sigma <= FIRST_IMAGE_RATIO * usual:
        return
    why, help_ = why_first(figures, name)
    text = (
        f"{name} is known to {degrees(sigma)} at the first image, to {degrees(usual)} in the"
        f" median: {why}"
    )
    yield ranked(name, sigma / usual / FIRST_IMAGE_RATIO, text, help_)


def why_first(figures: Figures, name: str) -> tuple[str, str]:
    """Why heading or tilt of the first image is weak, and what would help."""
    heading_range = figures["exposures"]["heading_range_before_first_deg"]
    why = slow_turns(heading_range)
    if name == "tilt":
        why = "too little was flown before it"
    elif heading_range < TURN_DEG:
        why = "no turn came before it"
    return why, "make a turn or a figure of eight before the first line"


def worst_image(figures: Figures) -> Iterator[Finding]:
    """Yield an image that is much less accurate than the others, but for the first."""
    exposures = figures["exposures"]
    if exposures is None:
        return
    for quantity, in_unit, key in (
        ("position", millimetres, "position_mm"),
        ("attitude", degrees, "attitude_deg"),
    ):
        worst, median = exposures[key]["worst"], exposures[key]["median"]
        ratio = max(worst["sigma"]) / max(median)
        if ratio > WORST_IMAGE_RATIO and worst["image"] != exposures["first_image"]:
            if quantity == "attitude":
                quantity = "heading" if worst["sigma"][2] > tilt(worst["sigma"]) else "tilt"
            text = (
                f"the {quantity} of image {worst['image']} at {at_time(figures, worst['time_s'])}"
                f" is known to {in_unit(max(worst['sigma']))}, {ratio:.1f} times the median"
            )
            yield ranked(
                "image",
                ratio / WORST_IMAGE_RATIO,
                text,
                "weigh it by its covariance in the adjustment",
            )


def outage(figures: Figures) -> Iterator[Finding]:
    """Yield the outage in which the sigmas grow most, and the number of the others."""
    if not figures["outages"] or figures["standing"]:
        return
    worst = max(
        figures["outages"], key=lambda each: (float(each["horizontal_mm"]), float(each["length_s"]))
    )
    median = max(figures["trajectory"]["position_mm"]["median"][:2])
    grown = (
        f"positions are known to {millimetres(worst['horizontal_mm'])} horizontally and"
        f" {millimetres(worst['down_mm'])} in height there"
    )
    text = no_fix(figures, worst)
    if worst["rejected"]:
        text += f" ({worst['rejected']} were rejected)"
    if worst["images"]:
        text += f", {image_range(worst)} in it"
    elif figures["exposures"]:
        text += ", and no image was taken in it"
    further = len(figures["outages"]) - 1
    others = f"; {further} more such {'time' if further == 1 else 'times'}" if further else ""
    rank = max(1.0, worst["horizontal_mm"] / 2**0.5 / median / OUTAGE_RATIO)
    help_ = "next time fly a turn before and after such a place" if worst["length_s"] > 10.0 else ""
    yield ranked("outage", rank, f"{text}: {grown}{others}", help_)


def segments(figures: Figures) -> Iterator[Finding]:
    """Yield the segments that were solved by themselves."""
    spans = figures["segments"]
    if len(spans) > 1:
        missing_s = sum(later[0] - earlier[1] for earlier, later in itertools.pairwise(spans))
        text = (
            f"the flight falls into {len(spans)} segments that are solved one by one, and for"
            f" {missing_s:.0f} s between them no image is oriented"
        )
        yield ranked("segments", float(len(spans)), text, "find why the IMU's recording breaks off")


def gaps(figures: Figures) -> Iterator[Finding]:
    """Yield the missing samples of the IMU."""
    bridged = figures["imu_gaps"]
    if bridged:
        longest = max(bridged, key=lambda gap: float(gap["length_s"]))
        counted = (
            "1 gap of the IMU was bridged,"
            if len(bridged) == 1
            else f"{len(bridged)} gaps of the IMU were bridged, the longest"
        )
        text = (
            f"{counted} of {longest['length_s']:.3f} s at {at_time(figures, longest['time_s'])}; "
            "the sigmas of the images include this"
        )
        help_ = "check the logger, as each gap makes the images after it less accurate"
        yield ranked("IMU gaps", max(REMARK, longest["length_s"] / LONG_IMU_GAP_S), text, help_)
