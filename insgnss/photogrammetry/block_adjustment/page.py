"""adjust.html: the page of an adjusted block, without outside files."""

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...base.files import atomic_write
from ...report.figures.block import Field, Ground, charts
from ...report.markup import escape, folded, sentence, table
from ...report.rules.wording import lengths
from ...report.verb_page import VerbPage
from .judgement import Judgement
from .solve import Solved

STRONG = 0.9  # a correlation that stands out
MODES = {
    "iso": "integrated sensor orientation",
    "indirect": "indirect: without aerial control",
    "fast_at": "Fast AT: ground points alone, camera held",
    "direct": "direct: poses and camera held",
}


def write_page(
    path: Path, solved: Solved, figures: Mapping[str, Any], judgement: Judgement, twin: str
) -> None:
    """Draw and write the page, whole or not at all.

    Parameters
    ----------
    path : Path
        The file.
    solved : Solved
        The block.
    figures : mapping
        Its figures.
    judgement : Judgement
        What is said of it.
    twin : str
        Text of adjust.json.
    """
    mood, why = _mood(judgement)
    page = VerbPage(
        f"{figures['name']}: adjustment",
        judgement.headline,
        mood,
        why,
        charts(figures, _fields(solved, judgement), ground_of(solved)),
        (_findings(judgement),),
        (_numbers(figures), _determined(judgement), *_parts(figures)),
        input_paths(solved),
        {"mode": MODES[figures["mode"]], "block file": solved.inputs.file.path.name},
        twin=twin,
    )
    atomic_write(path, page.html())


def input_paths(solved: Solved) -> list[Path]:
    """Return the files that the block is made of.

    Parameters
    ----------
    solved : Solved
        The block.

    Returns
    -------
    list of Path
        Those that the block file names, and itself.
    """
    file = solved.inputs.file
    own = (file.path, file.images.file, file.camera.file, file.aerial_control.file)
    every = (*own, file.ground.file, file.vehicle.file, file.vehicle.sizes)
    return [path for path in every if path is not None]


def _mood(judgement: Judgement) -> tuple[str, str]:
    """Return the colour of the bar, and why it has it."""
    worst = [f for f in judgement.findings if f.rank >= 1.0]
    if judgement.contradicted:
        return "bad", worst[0].found if worst else "observations contradict each other"
    undetermined = [name for name, word, _ in judgement.determined if word == "not determined"]
    if undetermined:
        return "good", (
            "no observation group contradicts another; not determined by this block, and held:"
            f" {', '.join(undetermined)}"
        )
    return "good", "no observation group contradicts another"


def _parts(figures: Mapping[str, Any]) -> Iterator[str]:
    """Yield what stands below the charts."""
    yield _components(figures)
    yield _control(figures)
    yield _vehicle(figures)
    yield _checks(figures)
    yield from (_correlations(c) for c in figures["cameras"] if len(c["correlated"]) > 1)
    yield _images(figures)
    yield _rejected(figures)
    yield _notes(figures)


def _correlations(camera: Mapping[str, Any]) -> str:
    """Correlations of the interior orientation; strong ones stand out."""
    names, rho = camera["correlated"], camera["correlation"]
    rows = [
        (
            escape(name),
            *(
                f"<b>{rho[i][j]:+.2f}</b>" if abs(rho[i][j]) > STRONG else f"{rho[i][j]:+.2f}"
                for j in range(i)
            ),
            *[""] * (len(names) - i),
        )
        for i, name in enumerate(names)
    ]
    head = ("", *map(escape, names))
    words = (
        "Coefficients of one polynomial are strongly correlated always; only what they make of a"
        " ray together counts."
    )
    return (
        f"<h2>Interior orientation: correlations of {escape(camera['name'])}</h2>\n"
        f'<p class="soft">{words}</p>\n' + table(rows, head, numbers=True)
    )


def ground_of(solved: Solved) -> Ground:
    """Return where images and points lie.

    Parameters
    ----------
    solved : Solved
        The block.

    Returns
    -------
    Ground
        What the maps show.
    """
    values = solved.result.values
    sigma = np.sqrt(np.diagonal(solved.precision.point_cov, axis1=1, axis2=2))
    good = np.isfinite(values.point[:, 0]) & np.isfinite(sigma).all(axis=1)
    return Ground(values.position, values.point[good], sigma[good], solved.control.lines)


def _fields(solved: Solved, judgement: Judgement) -> list[Field]:
    """Return the mean residuals of each camera."""
    return [
        Field(camera.name, (camera.width, camera.height), p.centre, p.mean, p.sigma)
        for camera, p in zip(solved.result.problem.block.cameras, judgement.patterns, strict=True)
    ]


def _findings(judgement: Judgement) -> str:
    if not judgement.findings:
        return "<h2>What stands out</h2>\n<p>Nothing.</p>\n"
    items = "".join(
        f'<li class="{f.verdict}">{escape(sentence(f.found))}'
        + (f' <span class="help">{escape(sentence(f.advice))}</span>' if f.advice else "")
        + "</li>\n"
        for f in judgement.findings
    )
    return f"<h2>What stands out</h2>\n<ul>\n{items}</ul>\n"


def _numbers(figures: Mapping[str, Any]) -> str:
    c = figures["counts"]
    points = figures["points"]["median_sigma_m"]
    rows = [
        ("mode", MODES[figures["mode"]]),
        ("images", f"{c['images']}, {c['with_aerial_control']} with aerial control"),
        ("object points", f"{c['points']}"),
        ("image observations", f"{c['image_observations']}, {c['rejected']} rejected"),
        ("ground control, check points", f"{c['ground_control']}, {c['check_points']}"),
        *(
            [("kinematic ground control", f"{v['exposures']}, {v['left_out']} left out")]
            if (v := figures["vehicle"]) is not None
            else []
        ),
        ("flight lines", _lines(figures)),
        ("redundancy", f"{figures['redundancy']}"),
        ("steps of the iteration", f"{figures['iterations']}"),
        ("covariance of aerial control", figures["covariance_of_aerial_control"]),
    ]
    if points is not None:
        rows.append(("median sigma of object points", lengths([1e3 * x for x in points])))
    if (px := figures["points"]["median_detectable_px"]) is not None:
        rows.append(("gross error of an image observation that would show", f"{px:.1f} px"))
    return "<h2>In numbers</h2>\n" + table([(escape(a), escape(b)) for a, b in rows])


def _lines(figures: Mapping[str, Any]) -> str:
    """Return the number of flight lines, and what is observed of them."""
    controls = Counter(line["control"] for line in figures["flight_lines"])
    words = ", ".join(f"{control} of {count}" for control, count in controls.items())
    return f"{figures['counts']['flight_lines']}" + (f" ({words})" if words else "")


def _determined(judgement: Judgement) -> str:
    rows = [(escape(a), escape(b), escape(c)) for a, b, c in judgement.determined]
    if not rows:
        return ""
    return "<h2>What was determined</h2>\n" + table(rows, ("unknown", "verdict", "value"))


def _components(figures: Mapping[str, Any]) -> str:
    rows = [
        (
            escape(c["name"]),
            str(c["observations"]),
            f"{c['redundancy']:.1f}",
            "–" if c["variance"] is None else f"{c['variance']:.3f}",
            "–" if c["factor"] == 1.0 else f"{c['factor'] ** 0.5:.3f}",
        )
        for c in figures["components"]
    ]
    head = (
        "observations",
        "number",
        "redundancy",
        "variance component",
        "their sigmas were multiplied by",
    )
    return "<h2>Variance components</h2>\n" + table(rows, head, numbers=True)


def _control(figures: Mapping[str, Any]) -> str:
    rows = [
        (
            escape(p["point"]),
            str(p["images"]),
            *(f"{1e3 * x:+.1f}" for x in p["residual_m"]),
            f"{max(p['w'], key=abs):+.1f}",
            *("–" if x is None else f"{1e3 * x:.0f}" for x in p["detectable_m"]),
        )
        for p in figures["ground_control"]
    ]
    if not rows:
        return ""
    head: tuple[str, ...] = ("point", "images", "E, mm", "N, mm", "U, mm", "largest w")
    head += ("error that would show: E, mm", "N, mm", "U, mm")
    body = table(rows, head, numbers=True)
    if len(rows) > 30:
        body = folded(f"{len(rows)} points", body)
    return "<h2>Ground control: surveyed minus adjusted</h2>\n" + body


def _vehicle(figures: Mapping[str, Any]) -> str:
    if figures["vehicle"] is None:
        return ""
    rows = [
        (
            escape(p["image"]),
            *(f"{1e3 * x:+.1f}" for x in p["residual_m"]),
            f"{max(p['w'], key=abs):+.1f}",
            *("–" if x is None else f"{x:+.2f}" for x in p["residual_px"]),
            f"{p['size_px']:.2f} {p['size_residual_px']:+.2f}" if "size_px" in p else "–",
            "left out" if p["left_out"] else "",
        )
        for p in figures["vehicle"]["points"]
    ]
    head: tuple[str, ...] = ("image", "E, mm", "N, mm", "U, mm", "largest w", "x, px", "y, px")
    head += ("size and its residual, px", "")
    body = table(rows, head, numbers=True)
    if len(rows) > 20:
        body = folded(f"{len(rows)} exposures", body)
    return "<h2>Kinematic ground control: trajectory of the vehicle minus adjusted</h2>\n" + body


def _checks(figures: Mapping[str, Any]) -> str:
    rows = [
        (
            escape(p["point"]),
            str(p["images"]),
            *(
                f"{1e3 * x:+.1f} ± {1e3 * s:.1f}"
                for x, s in zip(p["difference_m"], p["sigma_m"], strict=True)
            ),
            f"{p['normalised_square'] / 3.0:.2f}",
        )
        for p in figures["check_points"]
        if "difference_m" in p
    ]
    if not rows:
        return ""
    square = "normalised square, expected 1, by chance up to 3.8"
    head = ("point", "images", "E, mm", "N, mm", "U, mm", square)
    together = figures["check_points_together"]
    mean = together["normalised_square"] / together["degrees_of_freedom"]
    rows += [
        (words, "", *(f"{1e3 * x:+.1f}" if sign else f"{1e3 * x:.1f}" for x in together[key]), more)
        for words, key, sign, more in (
            ("mean", "mean_m", True, ""),
            ("root mean square", "rms_m", False, ""),
            ("largest", "largest_m", True, f"{mean:.2f} together"),
        )
    ]
    return "<h2>Check points: surveyed minus adjusted</h2>\n" + table(rows, head, numbers=True)


def _images(figures: Mapping[str, Any]) -> str:
    rows = [
        (
            escape(i["image"]),
            str(i["observations"]),
            str(i["rejected"]),
            "–" if i["rms_px"] is None else f"{i['rms_px']:.2f}",
            lengths([1e3 * x for x in i["sigma_m"]]),
            " / ".join(f"{np.degrees(x):.4f}" for x in i["sigma_rad"]),
            lengths([1e3 * x for x in i["moved_m"]]) if "moved_m" in i else "no aerial control",
        )
        for i in figures["images"]
    ]
    head: tuple[str, ...] = ("image", "points", "rejected", "rms, px", "sigma E N U")
    head += ("sigma of attitude E N U, deg", "moved by")
    body = table(rows, head, numbers=True)
    return "<h2>Image by image</h2>\n" + (
        folded(f"{len(rows)} images", body) if len(rows) > 20 else body
    )


def _rejected(figures: Mapping[str, Any]) -> str:
    rows = [
        (
            escape(r["image"]),
            escape(r["point"]),
            *("–" if x is None else f"{x:+.1f}" for x in r["residual_px"]),
        )
        for r in figures["rejected"]
    ]
    if not rows:
        return ""
    body = table(rows, ("image", "point", "x, px", "y, px"), numbers=True)
    title = f"{len(rows)} image observations that do not fit"
    return "<h2>Rejected</h2>\n" + folded(title, body)


def _notes(figures: Mapping[str, Any]) -> str:
    items = "".join(f"<li>{escape(sentence(note))}</li>\n" for note in figures["notes"])
    return f"<h2>Notes</h2>\n<ul>\n{items}</ul>\n" if items else ""
