"""The sections of the document of a run, each from the figures that report.json holds."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from ..base.findings import Finding, ranked
from .document import (
    Drawing,
    Marked,
    Section,
    Table,
    checks_section,
    dotted_keys,
    limit_sentences,
    pairs,
    strong,
)
from .rules.use import USE
from .rules.verdict import MOST_SENTENCES
from .rules.wording import NED_NAMES, at_time, clock, lengths, millimetres, no_fix, span

Summary = Mapping[str, Any]

DECISIVE_KEYS = {  # keys of the summary by table: what decides the result, on half a printed page
    "imu": ("file", "noise", "axes"),
    "gnss": ("file", "sigma_m", "datum", "epoch", "undulation_m", "time_offset_s"),
    "camera": ("events", "time_offset_s"),
    "mounting": ("antenna_m", "antenna_sigma_m", "imu_m"),
    "tangent_plane": ("lat_deg", "lon_deg", "height_m"),
    "output": ("need", "need_m", "need_deg", "crs", "geoid", "formats"),
}

NO_MATTER = "these change no image beyond the accuracy that is needed"


def three(values: Sequence[float | None] | None, form: str) -> str:
    """Values of the axes, one beside the other; a dash for what is not determined."""
    if values is None:
        return "–"
    return " / ".join("–" if v is None else format(v, f"z{form}") for v in values)


def limits(summary: Summary) -> Section:
    """Remarks on the flight but for the reasons of the verdict, the most important first."""
    reasons, topics = summary["use"]["reasons"], summary["use"]["topics"]
    outages = [
        cause
        for outage in summary["outages"]
        if any((cause := no_fix(summary, outage)) in reason for reason in reasons)
    ]
    listed = [
        ranked(remark["topic"], remark["rank"], remark["text"], remark["help"])
        for remark in summary["limits"]
        if remark["topic"] not in topics
        and remark["text"].partition(": ")[0] not in topics  # the name of a check
        and not any(remark["text"].partition(" (expected: ")[0] in reason for reason in reasons)
        and not any(cause in remark["text"] for cause in outages)
    ]
    usable = summary["use"]["verdict"] == USE
    introduction = [Marked(NO_MATTER, "soft")] if usable and listed else []
    matter = [] if usable else [remark for remark in listed if remark.rank >= 1.0][:MOST_SENTENCES]
    unimportant = limit_sentences(remark for remark in listed if remark not in matter)
    return Section(
        "Remarks", [*introduction, *limit_sentences(matter)], more=unimportant, brief=True
    )


def hidden_section(summary: Summary) -> Section:
    """Return what no data of the flight can reveal."""
    caption = (
        "no flight data reveal these errors; the sigmas include an error only where its row says so"
    )
    rows = [(x["name"], x["effect"], x["help"]) for x in summary["hidden_errors"]]
    header = ("Error", "what it does", "how to exclude it")
    return _captioned("What no flight can show", caption, Table(rows, header), brief=True)


def earlier(summary: Summary) -> Section:
    """Return what is different from earlier flights of the same equipment, where they are known."""
    season: Mapping[str, Any] | None = summary.get("earlier")
    if season is None:
        return Section("Compared with earlier flights")
    flights, different = season["flights"], season["different"]
    of = f"{flights} earlier flight{'s' * (flights > 1)} of {season['equipment']}, the last of"
    as_before, last = season["compared"] - len(different), season["last_utc"][:10]
    caption = (
        f"{as_before} of {season['compared']} figures (standard deviations, innovations, lever arm,"
        f" time offset, biases) are as in {of} {last} ({season['season']})"
    )
    rows = [
        (
            figure["name"],
            f"{figure['value']:.3g} {figure['unit']}".strip(),
            f"{figure['earlier']:.3g} {figure['unit']}".strip(),
            figure["help"],
        )
        for figure in different
    ]
    header = ("What differs", "this flight", "earlier flights", "what to do")
    parts = (Marked(caption, "soft"), Table(rows, header))
    return Section("Compared with earlier flights", parts, "page", brief=True)


def about(summary: Summary) -> str:
    """Return whose flight it is, with what and when it was flown and processed."""
    output, period = summary["flight"].get("output") or {}, summary["span"]
    included = summary["flight"].get("included") or ()
    equipment = output.get("equipment") or ", ".join(Path(file).stem for file in included[:1])
    parts = [
        f"{name} {text}"
        for name, text in (("operator", output.get("operator")), ("equipment", equipment))
        if text
    ]
    if period["gps_week"] is not None:
        begin, end = (clock(summary, period[key]) for key in ("start_tow_s", "end_tow_s"))
        parts.append(f"flown {begin:%Y-%m-%d %H:%M:%S} to {end:%H:%M:%S %Z}")
    run_date = [summary["run"][key] for key in ("date (UTC)",) if key in summary["run"]]
    parts += [f"processed {date} UTC" for date in run_date]
    return "; ".join(parts)


def settings(summary: Summary) -> Section:
    """Return the keys of the flight file that decide the result, and the versions."""
    tables = {
        name: {key: x for key in keys if (x := (summary["flight"].get(name) or {}).get(key))}
        for name, keys in DECISIVE_KEYS.items()
    } | {"versions": summary["versions"]}
    rows = [
        (name, Marked("; ".join(f"{key} {_plain(x)}" for key, x in table.items()), "code"))
        for name, table in tables.items()
        if table
    ]
    return Section("Settings and versions", [Table(rows)], "page", brief=True)


def _plain(value: object) -> str:
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


def images(summary: Summary) -> Section:
    """Return the section that the page's script fills with the table of images."""
    text = (
        "click a heading to sort, a row to mark the image in the map and in the charts. Standard"
        " deviations are of the projection centre and of the attitude about the axes of the tangent"
        " plane; flags say what is worth a look"
    )
    table = (
        '<div id="image-table"></div>\n<noscript><p class="soft">The table of'
        f" {summary['counts']['images']} images needs scripts; the exports hold all of"
        " it.</p></noscript>\n"
    )
    return Section("Image by image", [Marked(text, "soft"), Drawing(table)], "page")


def flight_lines(summary: Summary) -> Section:
    """Table of the straight lines: where, which images, how well they are known.

    The largest of each sigma stands out.
    """
    lines: Sequence[Mapping[str, Any]] = summary["lines"]
    columns: dict[str, Callable[[Mapping[str, Any]], str]] = {
        "Line": lambda line: str(line["line"]),
        **_clock_column(summary, "start_s", "end_s"),
        "TOW, s": lambda line: f"{line['start_s']:.1f} – {line['end_s']:.1f}",
        "course, deg": lambda line: f"{line['course_deg']:.0f}",
        "length, m": lambda line: f"{line['length_m']:.0f}",
        "images": lambda line: (
            f"{line['first_image']} – {line['last_image']} ({line['images']})"
            if line["images"]
            else "–"
        ),
        "horizontal": _with_largest(lines, "horizontal_mm", millimetres),
        "height": _with_largest(lines, "down_mm", millimetres),
        "tilt, deg": _with_largest(lines, "tilt_deg", "{:.3f}".format),
        "heading, deg": _with_largest(lines, "heading_deg", "{:.3f}".format),
    }
    caption = (
        "median standard deviations on each straight line, numbered as in the figures; the largest,"
        " where one is, is in bold"
    )
    table = Table.of(lines, columns, numbers=True, name="lines")
    return _captioned("Line by line", caption, table, brief=True)


def _clock_column(summary: Summary, *keys: str) -> dict[str, Callable[[Mapping[str, Any]], str]]:
    """Return the column of clock times, headed by their zone; without a GPS week none.

    Parameters
    ----------
    summary : of the run.
    keys : of a row's times of week, s: an instant, or a begin and an end.
    """
    if summary["span"]["gps_week"] is None:
        return {}

    def cell(row: Mapping[str, Any]) -> str:
        return " – ".join(f"{clock(summary, row[key]):%H:%M:%S}" for key in keys)

    return {f"{clock(summary, summary['span']['start_tow_s']):%Z}": cell}


def _with_largest(
    lines: Sequence[Mapping[str, Any]], key: str, form: Callable[[float], str]
) -> Callable[[Mapping[str, Any]], str]:
    """Return what a column says of a line; the largest value, where there is one, stands out."""
    cells = [form(line[key]) for line in lines]
    largest = form(max((line[key] for line in lines), default=0.0))
    is_single = len(cells) > 1 and cells.count(largest) == 1
    return lambda line: strong(form(line[key]), is_single and form(line[key]) == largest)


def fixes_by_line(summary: Summary) -> Section:
    """Return the fixes line by line: used, rejected, quality, satellites, PDOP, innovations."""
    lines: Sequence[Mapping[str, Any]] = summary["line_fixes"]

    def percent(fraction: float | None) -> str:
        return "–" if fraction is None else f"{100 * fraction:.0f}"

    def median_and_extreme(median: float | None, extreme: float | None, form: str) -> str:
        return "–" if median is None else f"{median:{form}} ({extreme:{form}})"

    columns: dict[str, Callable[[Mapping[str, Any]], str]] = {
        "Line": lambda line: str(line["line"]),
        "fixes used": lambda line: str(line["used"]),
        "rejected": lambda line: strong(str(line["rejected"]), line["rejected"] > 0),
        "fixed / float, %": lambda line: (
            f"{percent(line['fixed_share'])} / {percent(line['float_share'])}"
        ),
        "satellites (least)": lambda line: median_and_extreme(
            line["satellites"], line["least_satellites"], ".0f"
        ),
        "PDOP (largest)": lambda line: median_and_extreme(
            line["pdop"], line["largest_pdop"], ".1f"
        ),
        "mean innovation N / E / D, mm": lambda line: three(line["innovation_mm"], ".1f"),
        "sigma of one, mm": lambda line: three(line["innovation_sigma_mm"], ".1f"),
    }
    lines = lines if any(line["fixes"] for line in lines) else ()
    reported = {
        header: cell
        for header, cell in columns.items()
        if any(cell(line) not in ("–", "– / –") for line in lines)
    }
    caption = (
        "the fixes of each line, by the quality that their source states. A mean innovation "
        "beyond a fraction of the sigma of one fix is systematic: lever arm, time offset, or the "
        "fixes themselves"
    )
    table = Table.of(lines, reported, numbers=True, name="lines")
    return _captioned("GNSS line by line", caption, table)


def key_numbers(summary: Summary) -> Section:
    """Return the section of sigmas, counts, biases, and what supports them."""
    period, counts, biases = summary["span"], summary["counts"], summary["biases"]
    week = "" if period["gps_week"] is None else f"GPS week {period['gps_week']}, "
    length = f"{period['duration_s'] / 60:.1f} min"
    flight = f"{length}, {week}{span(summary, period['start_tow_s'], period['end_tow_s'])}"
    fixes = _counted(counts, "fixes", "")
    if counts["fixes_withheld"]:
        fixes += f" ({counts['fixes_withheld']} of them withheld as incorrect)"
    for key, noun in (("velocities", "velocities "), ("barometer_heights", "barometer heights ")):
        fixes += f"; {_counted(counts, key, noun)}" if key in counts else ""
    gaps = counts["imu_gaps"]
    imu = [
        f"{counts[key]} {key.removeprefix('imu_')}"
        for key in ("imu_samples", "epochs")
        if counts[key] is not None
    ]
    imu += [f"{counts['passes']} filter {'pass' if counts['passes'] == 1 else 'passes'}"]
    imu += ["no gap" if gaps == 0 else "1 gap bridged" if gaps == 1 else f"{gaps} gaps bridged"]
    rows = [
        ("Flight", flight),
        ("Images", str(counts["images"]) if counts["images"] else "none (no camera)"),
        (
            "GNSS fixes",
            "none: the sensor stands at a given place" if summary["standing"] else fixes,
        ),
        ("IMU", ", ".join(imu)),
        *([] if summary["standing"] else _consistency_rows(summary)),
    ]
    for sensor, name, unit, form in (
        ("gyro", "Gyro", "deg_h", "z.1f"),
        ("accel", "Accelerometer", "mg", "z.2f"),
    ):
        values = zip(biases[f"{sensor}_{unit}"], biases[f"{sensor}_sigma_{unit}"], strict=True)
        text = " / ".join(f"{value:{form}} ± {sigma:{form}}" for value, sigma in values)
        label = f"{name} bias at the end, {unit.replace('_', '/')}"
        rows.append((label, f"{text} (forward / right / down)"))
    return Section("Key numbers", [_sigma_table(summary), Table(rows)], "page")


def _counted(n: Mapping[str, Any], key: str, noun: str) -> str:
    return f"{noun}{n[key]}, {n[f'{key}_used']} used, {n[f'{key}_rejected']} rejected"


def _consistency_rows(summary: Summary) -> Iterator[tuple[str, str]]:
    """What the innovations and the two directions say of the sigmas."""
    for quantity, c in summary["consistency"].items():
        if c is not None:
            yield f"NIS of {quantity} per degree of freedom", _nis(c)
    ratios = summary["separation"]["normalised_rms"]
    listed = (f"{name} {three(ratios[name], '.2f')}" for name in ("position", "attitude"))
    yield (
        "Forward/backward separation over its sigma",
        f"{', '.join(listed)} (N / E / D; 1 expected)",
    )


def _nis(c: Mapping[str, Any]) -> str:
    if c["mean_per_dof"] is None:
        return "unknown: no fix was used"
    low, high = c["bounds_99"]
    share = f"{100 * c['share_beyond_95']:.1f} % beyond the 95 % line, 5 % expected"
    return f"{c['mean_per_dof']:.3f}, 99 % bounds {low:.3f} to {high:.3f}: {c['verdict']}; {share}"


def _sigma_table(summary: Summary) -> Table:
    """Return sigmas of the images, or of the trajectory where there are none."""
    claim = summary["exposures"] or summary["trajectory"]
    position, attitude = claim["position_mm"], claim["attitude_deg"]
    axes = " / ".join(claim["axes"])
    listed = [("Median", "median"), ("Smallest", "min"), ("Largest", "max")]
    listed += [(f"First image, {claim['first_image']}", "first")] if summary["exposures"] else []
    sigmas = [(label, position[key], attitude[key]) for label, key in listed]
    if neighbours := summary["neighbours"]:
        label = f"Median of the difference of neighbours ({neighbours['interval_s']:.1f} s apart)"
        sigmas.append((label, neighbours["position_mm"], neighbours["attitude_deg"]))
    rows = [(label, three(p, ".1f"), three(a, ".4f")) for label, p, a in sigmas]
    smoothed = "Smoothed standard deviations of the trajectory"
    title = "Standard deviations of the images" if summary["exposures"] else smoothed
    return Table(rows, (title, f"position {axes}, mm", f"attitude about {axes}, deg"), True)


def innovations(summary: Summary) -> Section:
    """Return the innovations in numbers."""
    figures = summary["innovations"]
    if figures["rms_mm"] is None:
        return Section("Innovations", [Marked("no fix was used", "text")], "page")
    columns = (figures[key] for key in ("mean_mm", "rms_mm", "median_sigma_mm", "lag1"))
    rows = [
        (axis, *map(millimetres, sizes), "–" if lag1 is None else f"{lag1:+z.3f}")
        for axis, *sizes, lag1 in zip(("north", "east", "down"), *columns, strict=True)
    ]
    lag = f"lag-1 correlation (99 %: ±{figures['lag1_bound_99']:.3f})"
    header = ("Innovations", "mean", "rms", "median sigma", lag)
    return Section("Innovations in numbers", [Table(rows, header, True)], "page")


def residuals(summary: Summary) -> Section:
    """Table of the means of fixes minus solution; what is beyond its limit is marked."""
    r = summary["residuals"] or {"pieces": (), "limit": 0.0, "beyond": 0}

    def mean(piece: Mapping[str, Any], axis: int) -> Marked:
        value, sigma = piece["mean_mm"][axis], piece["sigma_mm"][axis]
        text = f"{millimetres(value)} ± {millimetres(sigma)}"
        return Marked(text, "contradiction" if abs(value) > r["limit"] * sigma else "")

    columns: dict[str, Callable[[Mapping[str, Any]], Any]] = {
        **_clock_column(summary, "begin_s", "end_s"),
        "TOW, s": lambda piece: f"{piece['begin_s']:.1f} – {piece['end_s']:.1f}",
        "fixes": lambda piece: str(piece["fixes"]),
        **{name: partial(mean, axis=axis) for axis, name in enumerate(NED_NAMES)},
    }
    caption = (
        "mean of the used fixes minus the smoothed solution, ± one sigma as stated by both; no "
        "error model changes this mean. If the sigmas are right, it stays within "
        f"{r['limit']:.1f} sigma"
    )
    name = f"pieces, {r['beyond']} beyond the limit"
    table = Table.of(r["pieces"], columns, numbers=True, name=name)
    return _captioned("Fixes minus solution", caption, table)


def constants(summary: Summary) -> Section:
    """Return what was estimated besides: constants, and time-correlated errors of the fixes."""
    header = ("Constant", "value", "sigma", "before the flight", "its sigma moves a fix by")
    parts: list[Any] = [Table(list(map(_constant, summary["states"])), (*header, "observed"), True)]
    for error in summary["time_correlated_errors"]:
        share, white = (" / ".join(f"{x:.2f}" for x in error[key]) for key in ("share", "white"))
        text = (
            f"errors of {error['fixes']} fixes are not independent from fix to fix: a part of them,"
            f" {lengths([1e3 * x for x in error['sigma_m']])} north / east / down, has a"
            f" correlation time of {error['time_s']:.1f} s. That is {share} of the sigmas of the"
            f" fixes; {white} of them are independent"
        )
        parts.append(Marked(text, "text"))
    return Section("What was estimated besides", parts, "page")


def _constant(state: Mapping[str, Any]) -> tuple[str, ...]:
    factor, unit = state["per_unit"], state["unit"]
    digits = 4 if unit == "m" else 2
    return (
        state["name"],
        *(f"{state[key] * factor:z.{digits}f} {unit}" for key in ("value", "sigma")),
        f"± {state['prior'] * factor:.3g} {unit}",
        "–" if state["moves_m"] is None else millimetres(1e3 * state["moves_m"]),
        Marked("yes", "ok") if state["observed"] else Marked("no", "note"),
    )


def rejected_section(summary: Summary) -> Section:
    """Return the fixes that were not used."""
    rejected_fixes, first_s, withheld = (
        summary["rejected"],
        summary["span"]["start_tow_s"],
        summary["counts"]["fixes_withheld"],
    )
    listed: Sequence[Mapping[str, Any]] = rejected_fixes["listed"]
    columns: dict[str, Callable[[Mapping[str, Any]], str]] = {
        **_clock_column(summary, "time_s"),
        "TOW, s": lambda x: f"{x['time_s']:.3f}",
        "minute": lambda x: f"{(x['time_s'] - first_s) / 60:.2f}",
        "NIS": lambda x: "–" if x["nis"] is None else f"{x['nis']:.1f}",
    }
    shown_of_all = (
        f", the first {len(listed)} of them below" if rejected_fixes["count"] > len(listed) else ""
    )
    left_out = f" or withheld as incorrect ({withheld} of them)" if withheld else ""
    text = (
        f"{rejected_fixes['count']} fixes beyond the gate (NIS"
        f" {rejected_fixes['nis_limit']:.1f}){left_out}{shown_of_all}"
    )
    text = text if rejected_fixes["count"] else "no fix was rejected"
    table = Table.of(listed, columns, name="fixes")
    return Section("Rejected fixes", [Marked(text, "text"), table], "page")


def gaps(summary: Summary) -> Section:
    """Return the longest time without a fix, and the gaps of the IMU."""
    longest = summary["longest_outage"]
    text = (
        f"longest time without a used fix: {longest['length_s']:.2f} s from"
        f" {at_time(summary, longest['time_s'])} on; smoothed sigmas at most"
        f" {millimetres(longest['horizontal_mm'])} horizontally, {millimetres(longest['down_mm'])}"
        " down in it"
    )
    listed: Sequence[Mapping[str, Any]] = summary["imu_gaps"]
    columns: dict[str, Callable[[Mapping[str, Any]], str]] = {
        **_clock_column(summary, "time_s"),
        "IMU gap at TOW, s": lambda gap: f"{gap['time_s']:.3f}",
        "length, s": lambda gap: f"{gap['length_s']:.3f}",
    }
    none = [] if listed else [Marked("no gap of the IMU", "text")]
    table = Table.of(listed, columns, name="gaps of the IMU")
    return Section("Gaps", [Marked(text, "text"), *none, table], "page")


def segments_and_stationary_periods(summary: Summary) -> Section:
    """Return the segments solved by themselves, and the stationary periods."""
    parts = []
    if len(summary["segments"]) > 1:
        parts.append(
            Marked(f"solved by themselves: {_spans(summary, summary['segments'])}", "text")
        )
    if n := len(summary["rests"]):
        lasted = sum(end - start for start, end in summary["rests"])
        count = "1 stationary period" if n == 1 else f"{n} stationary periods"
        text = f"{count}, {lasted:.0f} s in all: {_spans(summary, summary['rests'])}"
        parts.append(Marked(text, "text"))
    return Section("Segments and stationary periods", parts, "page")


def _spans(summary: Summary, spans: Sequence[Sequence[float]]) -> str:
    return ", ".join(span(summary, start, end) for start, end in spans)


def checks(summary: Summary) -> Section:
    """Return the checks of the input, of which the sentences above have what matters."""
    keys = ("name", "found", "expected", "verdict", "advice")
    listed = [Finding(*(check[key] for key in keys)) for check in summary["checks"]]
    return checks_section(listed, "Checks of the input", "page")


def made_from(summary: Summary) -> Iterator[Section]:
    """History, resolved flight file, hashes of the inputs, versions, and times."""
    yield Section("What was done", summary["history"], "page")
    yield pairs("The flight file, resolved", dict(dotted_keys(summary["flight"])))
    yield pairs("Inputs (SHA-256)", summary["inputs_sha256"])
    yield pairs("The run", summary["run"])
    yield pairs("Versions", summary["versions"])
    yield pairs("Time taken", {step: f"{t:.2f} s" for step, t in summary["timings_s"].items()})


def _captioned(title: str, caption: str, table: Table, brief: bool = False) -> Section:
    """Return a section of a table below what it shows; empty without rows."""
    parts: list[str | Table] = [Marked(caption, "soft"), table] if table.rows else []
    return Section(title, parts, "page", brief=brief)
