"""report.html: one page without scripts or outside files, for the person who has to trust the images.

The order is that of the questions: what accuracy, what limits it, how it looks, what was checked and thrown away, from what it
was made. Every text is escaped; the pictures are PNG inside the page.
"""

import base64
import html
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..files import atomic_write
from ..records import Diagnostics, ExteriorOrientation
from .figures import Picture, pictures
from .summary import plain
from .verdict import NOTHING_STANDS_OUT, millimetres

Row = Sequence[str]

_STYLE = """
:root { color-scheme: light dark; --ink: #1c2430; --paper: #ffffff; --pale: #f3f5f8; --rule: #d5dae1; --soft: #5b6675;
  --ok: #00734f; --note: #a65200; --bad: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e8ee; --paper: #14181e; --pale: #1e242c; --rule: #38424f; --soft: #9aa6b5;
  --ok: #4cc9a0; --note: #f0a35a; --bad: #ff8a80; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 1040px; margin: 0 auto;
  padding: 1.5rem 1rem 4rem; overflow-wrap: break-word; }
h1 { font-size: 1.7rem; margin: 0; } h2 { font-size: 1.15rem; margin: 2.2rem 0 .5rem; }
.headline { margin: .4rem 0 1.2rem; padding: .7rem 1rem; background: var(--pale); border-left: 4px solid var(--ok); }
.headline.doubtful { border-color: var(--note); } .headline.bad { border-color: var(--bad); }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
td, th { text-align: left; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid var(--rule); vertical-align: top; }
th { color: var(--soft); font-weight: 600; } td.number { text-align: right; white-space: nowrap; } th.number { text-align: right; }
.wide { overflow-x: auto; } .ok { color: var(--ok); } .note { color: var(--note); } .contradiction { color: var(--bad); font-weight: 600; }
figure { margin: 0 0 1.2rem; } figure img { width: 100%; height: auto; background: #fff;
  border: 1px solid var(--rule); border-radius: 4px; }
figcaption, .soft { color: var(--soft); } code { font: 13px ui-monospace, monospace; overflow-wrap: anywhere; }
summary { cursor: pointer; } li { margin: .25rem 0; }
""".strip()


def write_report(path: str | Path, summary: Mapping[str, Any], diagnostics: Diagnostics, eo: ExteriorOrientation | None) -> Path:
    """Draw and write the page, whole or not at all; returns where it is.

    path : the file, or a directory that gets report.html.   summary : of `summary.run_summary`.   eo : None without a camera.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "report.html"
    atomic_write(path, page(summary, pictures(diagnostics, eo)))
    return path


def write_report_json(summary: Mapping[str, Any], path: str | Path) -> None:
    """Write `summary` to `path`, whole or not at all."""
    atomic_write(path, json.dumps(plain(summary), indent=2, allow_nan=False, ensure_ascii=False) + "\n")


def page(summary: Mapping[str, Any], drawn: Iterable[Picture]) -> Iterator[str]:
    """The HTML of the page, piece by piece."""
    name = summary["name"] or "flight"
    yield f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{_e(name)}: insgnss report</title>\n'
    yield f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<style>\n{_STYLE}\n</style>\n</head>\n<body>\n<main>\n'
    yield f'<h1>{_e(name)}</h1>\n<p class="headline {_mood(summary)}">{_e(summary["headline"])}.</p>\n'
    yield _key_numbers(summary)
    yield (
        "<h2>What limits this flight</h2>\n<ul>\n" + "".join(f"<li>{_e(_sentence(text))}</li>\n" for text in summary["verdict"]) + "</ul>\n"
    )
    for picture in drawn:
        yield f'<h2>{_e(picture.title)}</h2>\n<figure id="{_e(picture.name)}">\n<img alt="{_e(picture.title)}" src="data:image/png;base64,'
        yield base64.b64encode(picture.png).decode("ascii")
        yield f'">\n<figcaption>{_e(picture.reading)}</figcaption>\n</figure>\n'
    yield from (_innovations(summary), _checks(summary), _rejected(summary), _gaps(summary), _made_from(summary))
    yield "</main>\n</body>\n</html>\n"


def _e(value: object) -> str:
    return html.escape(str(value))


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def _mood(summary: Mapping[str, Any]) -> str:
    """good, doubtful or bad: bad for a contradiction, no fix used, or innovations far above their sigmas."""
    position = summary["consistency"]["position"]
    if any(check["verdict"] == "contradiction" for check in summary["checks"]) or not summary["counts"]["fixes_used"]:
        return "bad"
    if position["verdict"] == "overconfident" and position["mean_per_dof"] > 2.0:
        return "bad"
    return "good" if summary["verdict"] == [NOTHING_STANDS_OUT] else "doubtful"


def _table(rows: Iterable[Row], head: Row = (), numbers: bool = False) -> str:
    """Table of cells that are HTML already; `numbers` aligns all columns but the first to the right."""

    def cells(row: Row, tag: str) -> str:
        mark = ' class="number"' if numbers else ""
        return "<tr>" + "".join(f"<{tag}{mark if i else ''}>{cell}</{tag}>" for i, cell in enumerate(row)) + "</tr>\n"

    top = f"<thead>\n{cells(head, 'th')}</thead>\n" if head else ""
    return f'<div class="wide"><table>\n{top}<tbody>\n{"".join(cells(row, "td") for row in rows)}</tbody>\n</table></div>\n'


def _three(values: Sequence[float | None] | None, form: str) -> str:
    """Values of the axes, one beside the other; a dash for what is not determined."""
    return "–" if values is None else " / ".join("–" if v is None else format(v, f"z{form}") for v in values)


def _key_numbers(s: Mapping[str, Any]) -> str:
    span, n, separation, biases = s["span"], s["counts"], s["separation"]["normalised_rms"], s["biases"]
    week = "" if span["gps_week"] is None else f"GPS week {span['gps_week']}, "
    minutes = f"{span['duration_s'] / 60:.1f} min, {week}TOW {span['start_tow_s']:.1f} to {span['end_tow_s']:.1f} s"
    fixes = f"{n['fixes']}, {n['fixes_used']} used, {n['fixes_rejected']} rejected"
    if "velocities" in n:
        fixes += f"; velocities {n['velocities']}, {n['velocities_used']} used, {n['velocities_rejected']} rejected"
    imu = [f"{n[key]} {what}" for key, what in (("imu_samples", "samples"), ("epochs", "epochs")) if n[key] is not None]
    rows = [
        ("Flight", minutes),
        ("Images", str(n["images"]) if n["images"] else "none (no camera)"),
        ("GNSS fixes", fixes),
        ("IMU", ", ".join([*imu, f"{n['passes']} filter {'pass' if n['passes'] == 1 else 'passes'}", _gap_count(n["imu_gaps"])])),
        (
            "Forward/backward separation over its sigma",
            f"position {_three(separation['position'], '.2f')}, attitude {_three(separation['attitude'], '.2f')} (N / E / D; 1 expected)",
        ),
        ("Gyro bias at the end, deg/h", f"{_plus_minus(biases, 'gyro_deg_h', 'gyro_sigma_deg_h', 'z.1f')} (forward / right / down)"),
        ("Accelerometer bias at the end, mg", f"{_plus_minus(biases, 'accel_mg', 'accel_sigma_mg', 'z.2f')} (forward / right / down)"),
    ]
    for what, c in s["consistency"].items():
        if c is not None:
            rows.insert(3, (f"NIS of {what} per degree of freedom", _e(_nis(c))))
    return _sigma_table(s) + _table(rows)


def _plus_minus(biases: Mapping[str, Any], value: str, sigma: str, form: str) -> str:
    return " / ".join(f"{v:{form}} ± {s:{form}}" for v, s in zip(biases[value], biases[sigma], strict=True))


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
        (label, _three(position[key], ".1f"), _three(attitude[key], ".4f"))
        for label, key in (("Median", "median"), ("Smallest", "min"), ("Largest", "max"))
    ]
    if s["exposures"]:
        rows.append((f"First image, {_e(claim['first_image'])}", _three(position["first"], ".1f"), _three(attitude["first"], ".4f")))
    what = "Standard deviations of the images" if s["exposures"] else "Smoothed standard deviations of the trajectory"
    return _table(rows, (what, f"position {axes}, mm", f"attitude about {axes}, deg"), numbers=True)


def _innovations(s: Mapping[str, Any]) -> str:
    i = s["innovations"]
    if i["rms_mm"] is None:
        return "<h2>Innovations</h2>\n<p>No fix was used.</p>\n"

    rows = [
        (axis, millimetres(mean), millimetres(rms), millimetres(sigma), "–" if r is None else f"{r:+z.3f}")
        for axis, mean, rms, sigma, r in zip(
            ("north", "east", "down"), i["mean_mm"], i["rms_mm"], i["median_sigma_mm"], i["lag1"], strict=True
        )
    ]
    head = ("Innovations", "mean", "rms", "median sigma", f"lag-1 correlation (99 %: ±{i['lag1_bound_99']:.3f})")
    return "<h2>Innovations in numbers</h2>\n" + _table(rows, head, numbers=True)


def _checks(s: Mapping[str, Any]) -> str:
    if not s["checks"]:
        return ""
    rows = [
        (_e(c["name"]), _e(c["found"]), _e(c["expected"]), f'<span class="{_e(c["verdict"])}">{_e(c["verdict"])}</span>', _e(c["advice"]))
        for c in s["checks"]
    ]
    return "<h2>Checks of the input</h2>\n" + _table(rows, ("Check", "found", "expected", "verdict", "advice"))


def _rejected(s: Mapping[str, Any]) -> str:
    r = s["rejected"]
    if not r["count"]:
        return "<h2>Rejected fixes</h2>\n<p>No fix was rejected.</p>\n"
    start = s["span"]["start_tow_s"]
    rows = [
        (f"{x['time_s']:.3f}", f"{(x['time_s'] - start) / 60:.2f}", "–" if x["nis"] is None else f"{x['nis']:.1f}") for x in r["listed"]
    ]
    more = f", the first {len(r['listed'])} of them" if r["count"] > len(r["listed"]) else ""
    told = f"<p>{r['count']} fixes beyond the gate (NIS {r['nis_limit']:.1f}){more}:</p>\n"
    table = _table(rows, ("TOW, s", "minute", "NIS"))
    if len(rows) > 20:
        table = f"<details><summary>list</summary>\n{table}</details>\n"
    return "<h2>Rejected fixes</h2>\n" + told + table


def _gaps(s: Mapping[str, Any]) -> str:
    o = s["longest_outage"]
    sigmas = f"{millimetres(o['horizontal_mm'])} horizontally, {millimetres(o['down_mm'])} down"
    told = f"<p>Longest time without a used fix: {o['length_s']:.2f} s from TOW {o['time_s']:.2f} s on; smoothed sigmas at most "
    told += f"{sigmas} in it.</p>\n"
    rows = [(f"{gap['time_s']:.3f}", f"{gap['length_s']:.3f}") for gap in s["imu_gaps"]]
    return "<h2>Gaps</h2>\n" + told + (_table(rows, ("IMU gap at TOW, s", "length, s")) if rows else "<p>No gap of the IMU.</p>\n")


def _made_from(s: Mapping[str, Any]) -> str:
    """History, resolved flight file, versions, hashes of the inputs, and times."""
    history = "".join(f"<li>{_e(text)}</li>\n" for text in s["history"])
    parts = [f"<h2>What was done</h2>\n<ol>\n{history}</ol>\n" if history else ""]
    tables = (
        ("The flight file, resolved", _flat(s["flight"])),
        ("Inputs (SHA-256)", s["inputs_sha256"].items()),
        ("Versions", s["versions"].items()),
        ("Time taken", ((step, f"{seconds:.2f} s") for step, seconds in s["timings_s"].items())),
    )
    for title, rows in tables:
        cells = [(_e(key), f"<code>{_e(value)}</code>") for key, value in rows]
        parts.append(f"<h2>{title}</h2>\n{_table(cells)}" if cells else "")
    return "".join(parts)


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Dotted keys and values of nested tables, as in the flight file; what was left out is told by a dash."""
    for key, value in table.items():
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", "–" if value is None else str(value)
