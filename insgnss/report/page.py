"""report.html, one page without scripts or outside files.

It is for the person who has to trust the images.

The order is that of the questions: what accuracy, what limits it, line by line, how it looks, what
was checked and thrown away, from what it was made. Every text is escaped; the pictures are PNG
inside the page.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

from ..base.files import atomic_write
from ..records import Diagnostics, ExteriorOrientation
from .figures import gnss
from .figures.run import pictures
from .markup import Picture, document, escape, folded, pictured, table
from .rules.wording import millimetres
from .sections import constants, flight_lines, key_numbers, limits, segments_and_stationary_periods
from .summary import plain

# mean NIS a degree of freedom: beyond it the sigmas of the result are wrong by more than 40 %
FAR_ABOVE = 2.0


def write_report(
    path: str | Path,
    summary: Mapping[str, Any],
    diagnostics: Diagnostics,
    eo: ExteriorOrientation | None,
    receiver: Mapping[str, Any] | None = None,
) -> Path:
    """Draw and write the page, whole or not at all; returns where it is.

    Parameters
    ----------
    path : the file, or a directory that gets report.html.
    summary : of `summary.run_summary`.
    eo : None without a camera.
    receiver : series of a PPK solution, as `gnss.pictures` takes them.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "report.html"
    drawn = chain(
        pictures(diagnostics, eo, summary["standing"]),
        () if receiver is None else gnss.pictures(receiver),
    )
    atomic_write(path, page(summary, drawn))
    return path


def write_report_json(summary: Mapping[str, Any], path: str | Path) -> None:
    """Write `summary` to `path`, whole or not at all."""
    atomic_write(
        path, json.dumps(plain(summary), indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    )


def page(summary: Mapping[str, Any], drawn: Iterable[Picture]) -> Iterator[str]:
    """The HTML of the page, piece by piece."""
    return document(
        f"{summary['name'] or 'flight'}: insgnss report",
        summary["headline"],
        _mood(summary),
        _body(summary, drawn),
        heading=summary["name"] or "flight",
    )


def _body(summary: Mapping[str, Any], drawn: Iterable[Picture]) -> Iterator[str]:
    yield from (limits(summary), flight_lines(summary), key_numbers(summary), constants(summary))
    yield from (pictured(picture) for picture in drawn)
    if not summary["standing"]:
        yield from (_innovations(summary), _residuals(summary), _rejected(summary), _gaps(summary))
    yield from (segments_and_stationary_periods(summary), _checks(summary), _made_from(summary))


def _mood(summary: Mapping[str, Any]) -> str:
    """Return good, doubtful or bad.

    It is bad for a contradiction, no fix used, innovations far above their sigmas, or a solution
    that leaves its own fixes.
    """
    position, residuals = summary["consistency"]["position"], summary["residuals"]
    if (
        any(check["verdict"] == "contradiction" for check in summary["checks"])
        or not summary["counts"]["fixes_used"]
        or (residuals is not None and residuals["beyond"])
    ):
        return "bad"
    if (
        not summary["standing"]
        and position["verdict"] == "overconfident"
        and position["mean_per_dof"] > FAR_ABOVE
    ):
        return "bad"
    return "doubtful" if any(limit["rank"] >= 1.0 for limit in summary["limits"]) else "good"


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
        ("Versions", s["versions"].items()),
        ("Time taken", ((step, f"{seconds:.2f} s") for step, seconds in s["timings_s"].items())),
    )
    for title, rows in tables:
        cells = [(escape(key), f"<code>{escape(value)}</code>") for key, value in rows]
        parts.append(f"<h2>{title}</h2>\n{table(cells)}" if cells else "")
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
