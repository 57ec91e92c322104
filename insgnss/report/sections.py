"""The sections of the page that answer its first questions.

What limits the flight, which line is least accurate, what was estimated.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from .markup import Row, escape, explained, folded, sentence, table, three
from .rules.use import USE
from .rules.verdict import MOST_SENTENCES
from .rules.wording import lengths, millimetres

Summary = Mapping[str, Any]

# terms that say on pointing at them what they mean
NIS = explained(
    "NIS",
    "normalised innovation squared: the innovation of a fix squared over its covariance; one per"
    " degree of freedom in the mean where the sigmas are honest",
)
SEPARATION = explained(
    "Forward/backward separation",
    "the flight filtered backward minus the same forward; one sigma in the mean where both are"
    " honest",
)
PDOP = explained(
    "PDOP",
    "position dilution of precision: what the geometry of the satellites makes of the error of one"
    " range; below 2 is good, beyond 4 poor",
)
FIXED = explained(
    "fixed",
    "epochs whose integer ambiguities were resolved (centimetres); float: those whose were not"
    " (decimetres)",
)

NO_MATTER = "These change no image beyond the accuracy that is needed."
FEW = 3  # remarks that need not be folded away


def limits(s: Summary) -> str:
    """Remarks on the flight, the most important first, each with what would help.

    Many of them stand behind a line.
    """
    listed: Sequence[Mapping[str, Any]] = s["limits"]
    usable = s["use"]["verdict"] == USE
    first = f'<p class="soft">{escape(NO_MATTER)}</p>\n' if usable and listed else ""
    matter = [x for x in listed if x["rank"] >= 1.0][:MOST_SENTENCES]
    others = [x for x in listed if x not in matter]
    out = (
        "<h2>Remarks</h2>\n"
        + first
        + (f"<ol>\n{''.join(map(_limit, matter))}</ol>\n" if matter else "")
    )
    remarks = f"<ul>\n{''.join(map(_limit, others))}</ul>\n" if others else ""
    return out + (
        folded(f"and {len(others)} of less weight", remarks) if len(others) > FEW else remarks
    )


def _limit(limit: Mapping[str, Any]) -> str:
    help_ = f' <span class="help">{escape(sentence(limit["help"]))}</span>' if limit["help"] else ""
    return f"<li>{escape(sentence(limit['text']))}{help_}</li>\n"


def flight_lines(s: Summary) -> str:
    """Table of the straight lines: where, which images, how well they are known.

    The largest of each sigma stands out.
    """
    lines: Sequence[Mapping[str, Any]] = s["lines"]
    if not lines:
        return ""
    forms = (
        ("horizontal_mm", millimetres),
        ("down_mm", millimetres),
        ("tilt_deg", "{:.3f}".format),
        ("heading_deg", "{:.3f}".format),
    )
    worst = {key: form(max(line[key] for line in lines)) for key, form in forms}
    alone = {key: [form(x[key]) for x in lines].count(worst[key]) == 1 for key, form in forms}
    rows = [
        (
            str(line["line"]),
            f"{line['start_s']:.1f} – {line['end_s']:.1f}",
            f"{line['course_deg']:.0f}",
            f"{line['length_m']:.0f}",
            (
                f"{escape(line['first_image'])} – {escape(line['last_image'])} ({line['images']})"
                if line["images"]
                else "–"
            ),
            *(
                _strong(
                    form(line[key]), alone[key] and len(lines) > 1 and form(line[key]) == worst[key]
                )
                for key, form in forms
            ),
        )
        for line in lines
    ]
    head = (
        "Line",
        "TOW, s",
        "course, deg",
        "length, m",
        "images",
        "horizontal",
        "height",
        "tilt, deg",
        "heading, deg",
    )
    caption = (
        '<p class="soft">Median standard deviations on each straight line, numbered as in the'
        " figures; the largest, where one is, is in bold.</p>\n"
    )
    content = caption + table(rows, head, numbers=True)
    return "<h2>Line by line</h2>\n" + (
        folded(f"{len(lines)} lines", content) if len(lines) > 30 else content
    )


def images(s: Summary) -> str:
    """Return the section that the page's script fills with the table of images."""
    return (
        '<h2>Image by image</h2>\n<p class="soft">Click a heading to sort, a row to mark the image'
        " in the map and in the charts. Standard deviations are of the projection centre and of the"
        " attitude about the axes of the tangent plane; flags say what is worth a look.</p>\n"
        '<div id="image-table"></div>\n<noscript><p class="soft">The table of'
        f" {s['counts']['images']} images needs scripts; the exports hold all of it.</p></noscript>"
        "\n"
    )


def fixes_by_line(s: Summary) -> str:
    """Return the fixes line by line: used, rejected, quality, satellites, PDOP, innovations."""
    lines: Sequence[Mapping[str, Any]] = s["line_fixes"]
    if not any(line["fixes"] for line in lines):
        return ""

    def share(x: float | None) -> str:
        return "–" if x is None else f"{100 * x:.0f}"

    def pair(usual: float | None, extreme: float | None, form: str) -> str:
        return "–" if usual is None else f"{usual:{form}} ({extreme:{form}})"

    rows = [
        (
            str(line["line"]),
            str(line["used"]),
            _strong(str(line["rejected"]), line["rejected"] > 0),
            f"{share(line['fixed_share'])} / {share(line['float_share'])}",
            pair(line["satellites"], line["least_satellites"], ".0f"),
            pair(line["pdop"], line["largest_pdop"], ".1f"),
            three(line["innovation_mm"], ".1f"),
            three(line["innovation_sigma_mm"], ".1f"),
        )
        for line in lines
    ]
    head = (
        "Line",
        "fixes used",
        "rejected",
        f"{FIXED} / float, %",
        "satellites (least)",
        f"{PDOP} (largest)",
        "mean innovation N / E / D, mm",
        "sigma of one, mm",
    )
    stated = [k for k in range(len(head)) if any(row[k] not in ("–", "– / –") for row in rows)]
    caption = (
        '<p class="soft">The fixes of each line, by what their source says of them. A'
        " mean innovation beyond a fraction of the sigma of one fix is systematic: lever arm, time"
        " offset, or the fixes themselves.</p>\n"
    )
    content = caption + table(
        [[row[k] for k in stated] for row in rows], [head[k] for k in stated], numbers=True
    )
    return "<h2>GNSS line by line</h2>\n" + (
        folded(f"{len(lines)} lines", content) if len(lines) > 30 else content
    )


def _strong(text: str, strong: bool) -> str:
    return f"<b>{text}</b>" if strong else text


def constants(s: Summary) -> str:
    """Return the section on what was estimated besides positions and attitudes.

    It holds constants, and time-correlated errors of the fixes.
    """
    out = ""
    if s["states"]:
        head = (
            "Constant",
            "value",
            "sigma",
            "before the flight",
            "its sigma moves a fix by",
            "observed",
        )
        out += table([_constant(state) for state in s["states"]], head, numbers=True)
    for error in s["time_correlated_errors"]:
        size, white = (" / ".join(f"{x:.2f}" for x in error[key]) for key in ("share", "white"))
        out += (
            f"<p>Errors of {error['fixes']} fixes are not independent from fix to fix: a part of"
            f" them, {lengths([1e3 * x for x in error['sigma_m']])} north / east / down, changes"
            f" only over some {error['time_s']:.1f} s (correlation time {error['time_s']:.1f} s)."
            f" That is {size} of the sigmas of the fixes; {white} of them are independent.</p>\n"
        )
    return f"<h2>What was estimated besides</h2>\n{out}" if out else ""


def _constant(state: Mapping[str, Any]) -> Row:
    factor, unit = state["per_unit"], state["unit"]
    digits = 4 if unit == "m" else 2
    value, sigma = (f"{state[key] * factor:z.{digits}f} {unit}" for key in ("value", "sigma"))
    moves = "–" if state["moves_m"] is None else millimetres(1e3 * state["moves_m"])
    seen = ("ok", "yes") if state["observed"] else ("note", "no")
    marked = f'<span class="{seen[0]}">{seen[1]}</span>'
    return (
        escape(state["name"]),
        value,
        sigma,
        f"± {state['prior'] * factor:.3g} {unit}",
        moves,
        marked,
    )


def segments_and_stationary_periods(s: Summary) -> str:
    """Return the section on segments solved by themselves and on stationary periods."""
    out = ""
    if len(s["segments"]) > 1:
        spans = ", ".join(f"{start:.1f} to {end:.1f} s" for start, end in s["segments"])
        out += f"<p>Solved by themselves, TOW: {spans}.</p>\n"
    if s["rests"]:
        lasted = sum(end - start for start, end in s["rests"])
        periods = ", ".join(f"{start:.1f} to {end:.1f} s" for start, end in s["rests"])
        n = len(s["rests"])
        count = "1 stationary period" if n == 1 else f"{n} stationary periods"
        out += folded(f"{count}, {lasted:.0f} s in all", f"<p>Stationary, TOW: {periods}.</p>\n")
    return f"<h2>Segments and stationary periods</h2>\n{out}" if out else ""


def key_numbers(s: Summary) -> str:
    """Return the section of sigmas, counts, biases, and what supports them."""
    span, n, biases = s["span"], s["counts"], s["biases"]
    week = "" if span["gps_week"] is None else f"GPS week {span['gps_week']}, "
    minutes = (
        f"{span['duration_s'] / 60:.1f} min, {week}TOW {span['start_tow_s']:.1f} to"
        f" {span['end_tow_s']:.1f} s"
    )
    fixes = f"{n['fixes']}, {n['fixes_used']} used, {n['fixes_rejected']} rejected"
    if n["fixes_withheld"]:
        fixes += f" ({n['fixes_withheld']} of them withheld as incorrect)"
    if "velocities" in n:
        fixes += (
            f"; velocities {n['velocities']}, {n['velocities_used']} used,"
            f" {n['velocities_rejected']} rejected"
        )
    if "barometer_heights" in n:
        fixes += (
            f"; heights of the barometer {n['barometer_heights']}, {n['barometer_heights_used']}"
            f" used, {n['barometer_heights_rejected']} rejected"
        )
    imu = [
        f"{n[key]} {noun}"
        for key, noun in (("imu_samples", "samples"), ("epochs", "epochs"))
        if n[key] is not None
    ]
    rows = [
        ("Flight", minutes),
        ("Images", str(n["images"]) if n["images"] else "none (no camera)"),
        ("GNSS fixes", "none: the sensor stands at a given place" if s["standing"] else fixes),
        (
            "IMU",
            ", ".join(
                [
                    *imu,
                    f"{n['passes']} filter {'pass' if n['passes'] == 1 else 'passes'}",
                    _gap_count(n["imu_gaps"]),
                ]
            ),
        ),
        *([] if s["standing"] else _agreement(s)),
        (
            "Gyro bias at the end, deg/h",
            (
                f"{_plus_minus(biases, 'gyro_deg_h', 'gyro_sigma_deg_h', 'z.1f')} (forward / right"
                " / down)"
            ),
        ),
        (
            "Accelerometer bias at the end, mg",
            f"{_plus_minus(biases, 'accel_mg', 'accel_sigma_mg', 'z.2f')} (forward / right / down)",
        ),
    ]
    return "<h2>Key numbers</h2>\n" + _sigma_table(s) + table(rows)


def _agreement(s: Summary) -> list[Row]:
    """What the innovations and the two directions say of the sigmas."""
    rows: list[Row] = [
        (f"{NIS} of {quantity} per degree of freedom", escape(_nis(c)))
        for quantity, c in s["consistency"].items()
        if c is not None
    ]
    ratios = s["separation"]["normalised_rms"]
    text = (
        f"position {three(ratios['position'], '.2f')}, attitude {three(ratios['attitude'], '.2f')}"
        " (N / E / D; 1 expected)"
    )
    return [*rows, (f"{SEPARATION} over its sigma", text)]


def _plus_minus(biases: Mapping[str, Any], value: str, sigma: str, form: str) -> str:
    return " / ".join(
        f"{v:{form}} ± {s:{form}}" for v, s in zip(biases[value], biases[sigma], strict=True)
    )


def _gap_count(n: int) -> str:
    return "no gap" if n == 0 else "1 gap bridged" if n == 1 else f"{n} gaps bridged"


def _nis(c: Mapping[str, Any]) -> str:
    if c["mean_per_dof"] is None:
        return "unknown: no fix was used"
    low, high = c["bounds_99"]
    share = f"{100 * c['share_beyond_95']:.1f} % beyond the 95 % line, 5 % expected"
    return f"{c['mean_per_dof']:.3f}, 99 % bounds {low:.3f} to {high:.3f}: {c['verdict']}; {share}"


def _sigma_table(s: Mapping[str, Any]) -> str:
    """Standard deviations of the images, or of the trajectory where there are none."""
    claim = s["exposures"] or s["trajectory"]
    position, attitude = claim["position_mm"], claim["attitude_deg"]
    axes = " / ".join(claim["axes"])
    rows = [
        (label, three(position[key], ".1f"), three(attitude[key], ".4f"))
        for label, key in (("Median", "median"), ("Smallest", "min"), ("Largest", "max"))
    ]
    if s["exposures"]:
        rows.append(
            (
                f"First image, {escape(claim['first_image'])}",
                three(position["first"], ".1f"),
                three(attitude["first"], ".4f"),
            )
        )
    if s["neighbours"]:
        near = s["neighbours"]
        label = f"Median of the difference of neighbours ({near['interval_s']:.1f} s apart)"
        rows.append((label, three(near["position_mm"], ".1f"), three(near["attitude_deg"], ".4f")))
    title = (
        "Standard deviations of the images"
        if s["exposures"]
        else "Smoothed standard deviations of the trajectory"
    )
    return table(rows, (title, f"position {axes}, mm", f"attitude about {axes}, deg"), numbers=True)
