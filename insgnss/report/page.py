"""report.html, one page that needs nothing else: data and what draws them are in it.

It is for the person who has to trust the images.

The order is that of the questions: what accuracy, what limits it, where, image by image, line by
line, how it looks, what was checked and thrown away, from what it was made. Every text is escaped;
charts and the table of images are drawn by the page's own script.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ..base.files import atomic_write, text_sha256
from ..records import Diagnostics, ExteriorOrientation
from .charts.chart import Chart
from .charts.encoded import script_safe
from .charts.run import charts
from .image_table import image_table, track
from .markup import charted, document, embedded, escape, folded, table, with_contents
from .rules.use import mood
from .rules.wording import millimetres
from .sections import (
    constants,
    fixes_by_line,
    flight_lines,
    images,
    key_numbers,
    limits,
    segments_and_stationary_periods,
)
from .summary import plain

LONG_LIST = 40  # rows: a longer list of keys is folded
SHORT = {  # what the list of contents calls the sections; nothing: not in the list
    "remarks": "Remarks",
    "map": "Map",
    "image-by-image": "Images",
    "line-by-line": "Lines",
    "gnss-line-by-line": "GNSS by line",
    "motion": "Motion",
    "sigmas": "Sigmas",
    "image-sigmas": "Sigmas by image",
    "innovations": "Innovations",
    "innovation-distribution": "",
    "nis-distribution": "",
    "innovations-in-numbers": "",
    "residuals": "Residuals",
    "fixes-minus-solution": "",
    "biases": "IMU errors",
    "what-was-estimated-besides": "Constants",
    "constants": "",
    "separation": "Separation",
    "gnss-solution": "GNSS",
    "gnss-signals": "Signals",
    "rejected-fixes": "Rejected",
    "segments-and-stationary-periods": "Segments",
    "checks-of-the-input": "Checks",
    "the-flight-file-resolved": "Settings",
    "inputs-sha-256": "",
    "versions": "",
    "time-taken": "",
}


def write_report(
    path: str | Path,
    summary: Mapping[str, Any],
    diagnostics: Diagnostics,
    eo: ExteriorOrientation | None,
    series: Mapping[str, Any] | None = None,
    report_sha256: str = "",
) -> Path:
    """Write the page, whole or not at all; returns where it is.

    Parameters
    ----------
    path : the file, or a directory that gets report.html.
    summary : of `summary.run_summary`.
    eo : None without a camera.
    series : what the source of the fixes says of each epoch, as `charts.gnss` takes it.
    report_sha256 : SHA-256 of the text of report.json of the same run, as `write_report_json`
        returns it.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "report.html"
    shown = charts(diagnostics, eo, summary["standing"], series or None)
    data: dict[str, Any] = {"track": track(diagnostics)}
    if eo is not None and eo.images:
        data["images"] = image_table(diagnostics, eo)
    atomic_write(path, page(summary, shown, data, report_sha256))
    return path


def write_report_json(summary: Mapping[str, Any], path: str | Path) -> str:
    """Write `summary` to `path`, whole or not at all; returns the SHA-256 of the text."""
    import orjson

    form = orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE
    form |= orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS
    text = orjson.dumps(summary, default=plain, option=form).decode()
    atomic_write(path, text)
    return text_sha256(text)


def page(
    summary: Mapping[str, Any],
    shown: Sequence[Chart],
    data: Mapping[str, Any] = MappingProxyType({}),
    report_sha256: str = "",
) -> Iterator[str]:
    """The HTML of the page, piece by piece.

    Parameters
    ----------
    shown : the charts.
    data : what the script needs besides by name: "images" and "track" of `image_table`.
    """
    verdict, reason = mood(summary)
    word = summary["use"]["sentence"]
    why = f'<p class="reason {verdict}"><strong>{escape(word)}</strong>: {escape(reason)}.</p>\n'
    body = "".join(_body(summary, shown, "images" in data))
    blocks = (embedded(name, script_safe(block)) for name, block in data.items())
    return document(
        f"{summary['name'] or 'flight'}: insgnss report",
        summary["headline"],
        verdict,
        (why, with_contents(body, SHORT), *blocks),
        heading=summary["name"] or "flight",
        charts=shown,
        report_sha256=report_sha256,
    )


def _body(summary: Mapping[str, Any], shown: Sequence[Chart], with_images: bool) -> Iterator[str]:
    left = {chart.name: charted(chart) for chart in shown}

    def of(*names: str) -> str:
        return "".join(left.pop(name, "") for name in names)

    standing = summary["standing"]
    yield from (limits(summary), of("map"), images(summary) if with_images else "")
    yield from (flight_lines(summary), "" if standing else fixes_by_line(summary))
    yield key_numbers(summary)
    yield of("motion", "sigmas", "image-sigmas")
    yield of("innovations", "innovation-distribution", "nis-distribution")
    if not standing:
        yield _innovations(summary)
        yield of("residuals") + _residuals(summary)
    yield of("biases") + constants(summary) + of("constants", "separation")
    yield of("gnss-solution", "gnss-signals")
    yield of(*list(left))
    if not standing:
        yield from (_rejected(summary), _gaps(summary))
    yield from (segments_and_stationary_periods(summary), _checks(summary), _made_from(summary))


def _innovations(s: Mapping[str, Any]) -> str:
    i = s["innovations"]
    if i["rms_mm"] is None:
        return "<h2>Innovations</h2>\n<p>No fix was used.</p>\n"
    rows = [
        (
            axis,
            millimetres(mean),
            millimetres(rms),
            millimetres(sigma),
            "–" if r is None else f"{r:+z.3f}",
        )
        for axis, mean, rms, sigma, r in zip(
            ("north", "east", "down"),
            i["mean_mm"],
            i["rms_mm"],
            i["median_sigma_mm"],
            i["lag1"],
            strict=True,
        )
    ]
    head = (
        "Innovations",
        "mean",
        "rms",
        "median sigma",
        f"lag-1 correlation (99 %: ±{i['lag1_bound_99']:.3f})",
    )
    return "<h2>Innovations in numbers</h2>\n" + table(rows, head, numbers=True)


def _residuals(s: Mapping[str, Any]) -> str:
    """Table of the means of fixes minus solution; what is beyond its limit is marked."""
    r = s["residuals"]
    if r is None:
        return ""
    rows = [
        (
            f"{piece['begin_s']:.1f} – {piece['end_s']:.1f}",
            str(piece["fixes"]),
            *(
                _against(mean, sigma, r["limit"])
                for mean, sigma in zip(piece["mean_mm"], piece["sigma_mm"], strict=True)
            ),
        )
        for piece in r["pieces"]
    ]
    listed = table(rows, ("TOW, s", "fixes", "north", "east", "down"), numbers=True)
    caption = (
        '<p class="soft">Mean of the used fixes minus the smoothed solution, ± one sigma of what'
        " the solution and its fixes claim; no error model changes it. An honest flight stays"
        f" within {r['limit']:.1f} sigma.</p>\n"
    )
    if len(rows) > 20:
        listed = folded(f"{len(rows)} pieces, {r['beyond']} beyond the limit", listed)
    return "<h2>Fixes minus solution</h2>\n" + caption + listed


def _against(mean: float, sigma: float, limit: float) -> str:
    text = f"{millimetres(mean)} ± {millimetres(sigma)}"
    return f'<span class="contradiction">{text}</span>' if abs(mean) > limit * sigma else text


def _checks(s: Mapping[str, Any]) -> str:
    if not s["checks"]:
        return ""
    rows = []
    for check in s["checks"]:
        name, finding, expected, verdict, advice = (
            escape(check[key]) for key in ("name", "found", "expected", "verdict", "advice")
        )
        rows.append((name, finding, expected, f'<span class="{verdict}">{verdict}</span>', advice))
    return "<h2>Checks of the input</h2>\n" + table(
        rows, ("Check", "found", "expected", "verdict", "advice")
    )


def _rejected(s: Mapping[str, Any]) -> str:
    r = s["rejected"]
    if not r["count"]:
        return "<h2>Rejected fixes</h2>\n<p>No fix was rejected.</p>\n"
    start = s["span"]["start_tow_s"]
    rows = [
        (
            f"{x['time_s']:.3f}",
            f"{(x['time_s'] - start) / 60:.2f}",
            "–" if x["nis"] is None else f"{x['nis']:.1f}",
        )
        for x in r["listed"]
    ]
    more = f", the first {len(r['listed'])} of them" if r["count"] > len(r["listed"]) else ""
    withheld = s["counts"]["fixes_withheld"]
    left_out = f" or withheld as incorrect ({withheld} of them)" if withheld else ""
    gate = f"beyond the gate (NIS {r['nis_limit']:.1f}){left_out}"
    intro = f"<p>{r['count']} fixes {gate}{more}:</p>\n"
    listed = table(rows, ("TOW, s", "minute", "NIS"))
    if len(rows) > 20:
        listed = folded("list", listed)
    return "<h2>Rejected fixes</h2>\n" + intro + listed


def _gaps(s: Mapping[str, Any]) -> str:
    o = s["longest_outage"]
    sigmas = f"{millimetres(o['horizontal_mm'])} horizontally, {millimetres(o['down_mm'])} down"
    text = (
        f"<p>Longest time without a used fix: {o['length_s']:.2f} s from TOW {o['time_s']:.2f} s"
        " on; smoothed sigmas at most "
    )
    text += f"{sigmas} in it.</p>\n"
    rows = [(f"{gap['time_s']:.3f}", f"{gap['length_s']:.3f}") for gap in s["imu_gaps"]]
    if not rows:
        return "<h2>Gaps</h2>\n" + text + "<p>No gap of the IMU.</p>\n"
    listed = table(rows, ("IMU gap at TOW, s", "length, s"))
    return (
        "<h2>Gaps</h2>\n"
        + text
        + (folded(f"{len(rows)} gaps of the IMU", listed) if len(rows) > 20 else listed)
    )


def _made_from(s: Mapping[str, Any]) -> str:
    """History, resolved flight file, versions, hashes of the inputs, and times."""
    history = "".join(f"<li>{escape(text)}</li>\n" for text in s["history"])
    parts = [f"<h2>What was done</h2>\n<ol>\n{history}</ol>\n" if history else ""]
    tables = (
        ("The flight file, resolved", _flat(s["flight"])),
        ("Inputs (SHA-256)", s["inputs_sha256"].items()),
        ("The run", s["run"].items()),
        ("Versions", s["versions"].items()),
        ("Time taken", ((step, f"{seconds:.2f} s") for step, seconds in s["timings_s"].items())),
    )
    for title, listed in tables:
        cells = [(escape(key), f"<code>{escape(value)}</code>") for key, value in listed]
        listed_cells = table(cells)
        if len(cells) > LONG_LIST:
            listed_cells = folded(f"{len(cells)} keys", listed_cells)
        parts.append(f"<h2>{title}</h2>\n{listed_cells}" if cells else "")
    return "".join(parts)


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Dotted keys and values of nested tables, as in the flight file.

    What was left out is a dash.
    """
    for key, value in table.items():
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", "–" if value is None else str(value)
