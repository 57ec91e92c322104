"""What an adjusted block says of itself in sentences: what contradicts, what was determined or not.

A group of observations contradicts its standard deviations where its variance component lies
outside the two-sided 99.9 % bounds of chi-square over its redundancy, and is worse by a fifth. What
explains it has been tried (`trials`).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.findings import Finding, ranked
from ...base.quantiles import chi_square_quantile
from ...base.wording import some
from ...flight.config.block_file import OBSERVATION_GROUPS
from ...report.rules.wording import lengths, screen_unit
from ..adjust.aerial import BORESIGHT, CAMERA_LEVER_ARM
from ..adjust.outliers import LIMIT_W
from ..adjust.precision import IMAGE
from ..adjust.separation import NORMAL
from .aerial.control import processed_with
from .aerial.relative import WEAK_DATUM
from .aerial.unstated_arm import alike, long_lever_arm, unnoticed
from .parameters import SIGNIFICANT_SIGMAS, determined_unknowns
from .residuals.pattern import Pattern, patterns, repeating
from .residuals.surveys import shift_of_check_points, two_surveys
from .solve import GROUND_CONTROL, AdjustedBlock
from .trials import RIVAL_GAIN, Trial, trials
from .vehicle.verdict import headline_words, left_out, wrong_target_size

# of chi-square, either side: one component in a thousand lies outside by chance
BOUND_CHANCE = 0.9995
WORSE_FACTOR = 1.2  # of a standard deviation, from which on a contradiction matters (chosen)
MANY_REJECTED = 0.05  # share of all image observations, beyond which it is reported (chosen)
# shares rejected, of an image that is named and of usual ones; chance of it in a block (chosen)
MOST_OF_IMAGE, USUAL_REJECTED, IMAGE_CHANCE = 0.3, 0.02, 1e-5
DISCONNECTED_GROUND = 8.0  # times the share of ground control, for its rank
TOO_LARGE = 5.0
"""Times its standard deviations of a contradiction, or of a projection centre that its cause moves,
beyond which no orientation is written."""
CHECK_POINTS = "check points"
ALONE = 0.95  # rank of one check point that contradicts alone
HELD_WORSE = 4.0
"""The same of rays from held poses; 6e-5 of normal errors are farther off."""
HIDDEN = 1e-6
"""Chance that an unknown of no effect is called one."""
STRONG_CORRELATION = 0.95  # of a correlation that is worth a sentence


@dataclass(frozen=True, eq=False)
class Judgement:
    """What is said of an adjusted block.

    Parameters
    ----------
    headline : str
        The most important thing, without full stop.
    findings : tuple of Finding
        What stands out, the worst first; of rank one and more it contradicts.
    determined : tuple of tuple of str
        Each unknown with its verdict, "determined", "improved" or "not determined", and a sentence.
    patterns : tuple of Pattern
        Of the residuals on the format, a camera each.
    trials_made : tuple of Trial
        What was tried to explain a contradiction.
    refused : tuple of Finding
        Contradictions that are too large for a result, and that the block file does not accept.
    """

    headline: str
    findings: tuple[Finding, ...]
    determined: tuple[tuple[str, str, str], ...]
    patterns: tuple[Pattern, ...]
    trials_made: tuple[Trial, ...]
    refused: tuple[Finding, ...] = ()

    @property
    def contradicted(self) -> bool:
        """Whether anything contradicts."""
        return any(finding.rank >= 1.0 for finding in self.findings)


def judge_block(
    solved: AdjustedBlock, figures: Mapping[str, Any], progress: Callable[[str], None]
) -> Judgement:
    """Judge an adjusted block.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.
    figures : mapping
        Its figures.
    progress : callable
        Is called with the name of each step.

    Returns
    -------
    Judgement
        Headline, findings, what was determined.
    """
    file, drawn = solved.inputs.file, patterns(solved)
    beyond = [*_components(figures), *_checks(figures)]
    beyond += [*_judge_disconnected(figures), *left_out(figures), *wrong_target_size(figures)]
    if not solved.direct:  # errors of the poses repeat from image to image
        beyond += repeating(figures, drawn)
    contradicted = any(finding.rank >= 1.0 for finding in beyond)
    trials_made = trials(solved, _excess(figures), progress, everything=contradicted)
    if contradicted and (surveys := two_surveys(solved)) is not None:
        trials_made = (surveys, *(replace(t, explains=False, gain=0.0) for t in trials_made))
    if contradicted:
        shown_anyway = tuple(replace(t, explains=True) for t in trials_made if t.gain > _limit(t))
        of_checks = shift_of_check_points(solved)
        smoothed = file.aerial_control.relative_weights == "smoothed"
        done = (*shown_anyway, *((of_checks,) if of_checks is not None else ()), *trials_made)
        beyond = [
            _explain_contradiction(
                one, done if one.name == CHECK_POINTS else trials_made, solved.direct, smoothed
            )
            for one in beyond
        ]
    else:
        beyond += [*_judge_hidden(trials_made), *unnoticed(solved, trials_made, HIDDEN)]
        beyond += long_lever_arm(solved, figures, trials_made)
    findings = [*beyond, *_control(figures), *_judge_rejected(figures), *_images(solved)]
    findings += [*_mounting(figures, alike(solved, trials_made)), *_weakly_held(figures)]
    findings += [*_lever_arm(solved), *_correlations(figures)]
    findings += [] if solved.inputs.unchecked is None else [solved.inputs.unchecked]
    ordered = tuple(sorted(findings, key=lambda finding: -finding.rank))
    accepted = file.adjustment.accept
    wrong = {f.name for f in beyond if f.rank >= TOO_LARGE}
    if any(t.moves_sigmas > TOO_LARGE for t in trials_made if t.explains or t.gain > _limit(t)):
        wrong |= {f.name for f in beyond if f.rank >= 1.0}
    too_large = {name for name in wrong if accepted_as(name) not in (*accepted, "camera")}
    if _worst_check_points(figures) < TOO_LARGE:
        too_large.discard(CHECK_POINTS)
    return Judgement(
        _headline(figures, ordered),
        ordered,
        tuple(determined_unknowns(figures)),
        drawn,
        trials_made,
        tuple(finding for finding in ordered if finding.name in too_large and finding.rank >= 1.0),
    )


def accepted_as(name: str) -> str:
    """Return the name by which adjustment.accept takes a finding.

    Parameters
    ----------
    name : str
        Its name.

    Returns
    -------
    str
        Its own, or "aerial control" where it is what a trial has shown.
    """
    return name if name in (*OBSERVATION_GROUPS, CHECK_POINTS, "camera") else "aerial control"


def _worst_check_points(figures: Mapping[str, Any]) -> float:
    """Return how many times too far off half of the check points are at least."""
    squares = [c["normalised_square"] for c in figures["check_points"] if "difference_m" in c]
    return float(np.sqrt(np.median(squares) / 3.0)) if squares else 0.0


def _bounds(redundancy: float) -> tuple[float, float]:
    """Return the two-sided 99.9 % bounds of a variance component."""
    low, high = (
        chi_square_quantile(redundancy, above) for above in (BOUND_CHANCE, 1.0 - BOUND_CHANCE)
    )
    return low / redundancy, high / redundancy


def _components(figures: Mapping[str, Any]) -> Iterator[Finding]:
    for c in figures["components"]:
        if c["variance"] is None or c["redundancy"] < 2.0 or c["name"] in ("mounting", WEAK_DATUM):
            continue
        if figures["mode"] == "direct":
            yield from _rays_apart(c)
            continue
        factor = c["factor"]
        if factor != 1.0:  # its variances were multiplied
            times = float(np.sqrt(factor))
            if times > 3.0 or times < 1.0 / 3.0:
                yield ranked(
                    c["name"],
                    1.0 if times > 3.0 else 0.5,
                    f"{c['name']} have {times:.2g} times the standard deviations that were stated",
                    "state this standard deviation, or look for another camera model or"
                    " wrong points",
                )
            continue
        low, high = _bounds(c["redundancy"])
        v = c["variance"]
        times = float(np.sqrt(v))
        if v > max(high, WORSE_FACTOR**2):
            yield ranked(
                c["name"],
                times,
                f"{c['name']} contradicts the rest: its residuals are {times:.1f} times what its"
                f" standard deviations allow (variance {v:.2f}, expected {low:.2f} to {high:.2f})",
            )
        elif v < min(low, 1.0 / WORSE_FACTOR**2):
            yield ranked(
                c["name"],
                0.5,
                f"{c['name']} is better than stated: its residuals are {times:.2f} times what its"
                f" standard deviations say (variance {v:.2f}, expected {low:.2f} to {high:.2f})",
            )


def _rays_apart(component: Mapping[str, Any]) -> Iterator[Finding]:
    """Rays of held poses that do not meet as their covariance promises.

    One error that all images share, such as of the heading, moves all residuals alike: there is no
    more than one degree of freedom to count on.
    """
    times = float(np.sqrt(component["variance"]))
    if times > HELD_WORSE:
        yield ranked(
            component["name"],
            times,
            f"rays from the held poses pass {times:.1f} times as far from each other as covariances"
            " of poses and image observations allow",
        )


def _weakly_held(figures: Mapping[str, Any]) -> Iterator[Finding]:
    """Flight lines of relative control that no ground point, tie point or position holds."""
    if not (chains := figures["weakly_held"]):
        return
    options = figures["block_file"]["aerial_control"]
    images = sum(chain["images"] for chain in chains)
    first = chains[0]["image"]
    unknowns, sigmas = [], []
    if any(chain["position"] for chain in chains):
        unknowns.append("where they lie")
        sigmas.append(f"{options['datum_sigma_m']:g} m")
    if any(chain["attitude"] for chain in chains):
        unknowns.append("how they are turned")
        sigmas.append(f"{options['datum_sigma_deg']:g} deg")
    yield ranked(
        "relative control",
        0.95,
        f"relative control of {images} image{'s' * (images > 1)} in {len(chains)} flight"
        f" line{'s' * (len(chains) > 1)} or turns, that of {first} first, and no observation"
        f" determines {' or '.join(unknowns)}: a weak observation ({' and '.join(sigmas)}) of"
        " one image of each holds them",
        "measure ground points in their images, or observe them absolutely (aerial_control.lines)",
    )


def _checks(figures: Mapping[str, Any]) -> Iterator[Finding]:
    together = figures["check_points_together"]
    if not (degrees := together["degrees_of_freedom"]):
        return
    _, high = _bounds(degrees)
    mean = together["normalised_square"] / degrees
    if mean > max(high, WORSE_FACTOR**2):
        worst = max(
            (c for c in figures["check_points"] if "difference_m" in c),
            key=lambda c: (c["point"] == together["contradicts_alone"], c["normalised_square"]),
        )
        difference = f"{lengths([1e3 * x for x in worst['difference_m']])} (east, north, up)"
        if together["contradicts_alone"]:  # it takes no part, so that no image depends on it
            yield ranked(
                CHECK_POINTS,
                ALONE,
                f"check point {worst['point']} lies {difference} from where its {worst['images']}"
                " images see it, the other check points fit; no image depends on it",
                "check its coordinates, and that the images show the surveyed place",
            )
            return
        times = float(np.sqrt(mean))
        sentence = f"check points lie {times:.1f} times as far off as their covariance allows"
        yield ranked(CHECK_POINTS, times, f"{sentence}, {worst['point']} by {difference}")


def _judge_disconnected(figures: Mapping[str, Any]) -> Iterator[Finding]:
    """Ground control that contradicts the rest so much that it has no image observation left."""
    control = figures["ground_control"]
    alone = [point["point"] for point in control if point["images"] == 0]
    if alone:
        yield ranked(
            GROUND_CONTROL,
            DISCONNECTED_GROUND * len(alone) / len(control) + 1.0,
            f"{len(alone)} of {len(control)} ground control points do not fit the rest, and all of"
            f" their image observations were left out: {some(alone)}",
        )


def _images(solved: AdjustedBlock) -> Iterator[Finding]:
    """Images of whose observations many take no part, which chance does not do."""
    from scipy.special import bdtrc

    problem = solved.result.problem
    block = problem.block
    observations = block.observations
    shared = np.bincount(observations.point, minlength=len(block.points))[observations.point] > 1
    active = problem.active
    n = len(block.images)
    total = np.bincount(observations.image[shared], minlength=n)
    missing = np.bincount(observations.image[shared & ~active], minlength=n)
    share = missing / np.maximum(total, 1)
    usual = max(USUAL_REJECTED, 2.0 * float((shared & ~active).sum() / max(1, shared.sum())))
    chance = bdtrc(missing - 1, total, min(usual, 0.5))
    beyond = np.flatnonzero((share > MOST_OF_IMAGE) & (chance < IMAGE_CHANCE / n))
    if beyond.size:
        worst = int(beyond[np.argmax(share[beyond])])
        more = f", and such a share in {beyond.size - 1} more" if beyond.size > 1 else ""
        name = block.images[worst]
        yield ranked(
            IMAGE,
            1.0 + float(share[worst]),
            f"{missing[worst]} of {total[worst]} image observations of {name} do not fit and were"
            f" left out{more}",
            f'check its name and its stamp, or leave it out by images.skip = ["{name}"]',
        )


def _lever_arm(solved: AdjustedBlock) -> Iterator[Finding]:
    """A bore-sight that turned the lever arm to the antenna when the flight was processed."""
    turn = solved.result.values.blocks.get((BORESIGHT, 0))
    flight = processed_with(solved.inputs)
    if turn is None or flight is None or solved.inputs.eo is None:
        return
    lever = np.array(flight["mounting"]["antenna_m"], dtype=np.float64)
    displacement = float(np.linalg.norm(turn @ lever - lever))
    cov = solved.inputs.eo.cov
    sigma = float(np.sqrt(np.median(np.trace(cov[:, :3, :3], axis1=1, axis2=2)) / 3.0))
    if displacement > SIGNIFICANT_SIGMAS * sigma:
        yield ranked(
            BORESIGHT,
            displacement / (SIGNIFICANT_SIGMAS * sigma),
            "the flight was processed with a wrong bore-sight, which turned the lever arm of"
            f" {np.linalg.norm(lever):.2f} m to the antenna: projection centres are off by"
            f" {lengths([1e3 * displacement])} ({displacement / sigma:.0f} sigma)",
            "process with --mounting mounting.toml, which is written here, and adjust again",
        )


def _excess(figures: Mapping[str, Any]) -> float:
    """Return by how much the cost of groups is above their redundancy."""
    return sum(
        max(0.0, (c["variance"] - 1.0) * c["redundancy"])
        for c in figures["components"]
        if c["variance"] is not None
    )


def _limit(trial: Trial) -> float:
    """Return the gain that an unknown of no effect has by chance at most."""
    return chi_square_quantile(trial.unknowns, HIDDEN)


def _judge_hidden(trials_made: tuple[Trial, ...]) -> Iterator[Finding]:
    """What the block file leaves out, and the observations show without a contradiction."""
    for trial in trials_made[:1]:
        limit = _limit(trial)
        if trial.gain > limit:
            yield ranked(
                trial.name,
                float(np.sqrt(trial.gain / limit)),
                f"the observations show an unmodelled {trial.name} of {trial.shown}:"
                f" estimating it lowers the weighted squares of the residuals by {trial.gain:.0f}"
                f" (by chance {limit:.0f} at most)",
                f"{trial.remedy}{_rivals(trial, trials_made)}",
            )


def _rivals(best: Trial, good: Sequence[Trial]) -> str:
    """Name the explanations that do nearly as well as the best; empty where there is none."""
    alike = {t.name: t for t in good if t.name != best.name and t.gain > RIVAL_GAIN * best.gain}
    return "".join(
        f"; {t.name} of {t.shown} explains it nearly as well: {t.remedy}" for t in alike.values()
    )


def _explain_contradiction(
    finding: Finding, trials_made: tuple[Trial, ...], direct: bool, smoothed: bool
) -> Finding:
    """Add what explains a contradiction: the best of those that do."""
    if finding.rank < 1.0 or not (trials_made or direct):
        return finding
    good = [trial for trial in trials_made if trial.explains]
    if good:
        best = good[0]
        remedy = f"{best.name} of {best.shown} explains it: {best.remedy}{_rivals(best, good)}"
        if direct:
            remedy += "; where poses are held, errors of camera constant and bore-sight look alike"
    elif direct:
        remedy = "adjust the same files in mode fast_at or iso, which search for the cause"
    else:
        names = ", ".join(trial.name for trial in trials_made)
        weights = "" if smoothed else " (those of aerial_control.relative_weights among them)"
        remedy = (
            f"tried without success: {names}; look for gross errors, exchanged names, or"
            f" standard deviations that are too small{weights}"
        )
    return replace(finding, remedy=remedy)


def _control(figures: Mapping[str, Any]) -> Iterator[Finding]:
    """Ground control points with gross errors, which were rejected."""
    for point in figures["rejected_ground_control"]:
        residual = ""  # of a point that nothing else observes
        if None not in point["residual_m"]:
            residual = f"{lengths([1e3 * x for x in point['residual_m']])} (east, north, up), "
        yield ranked(
            GROUND_CONTROL,
            max(1.0, point["w"] / LIMIT_W),
            f"ground control point {point['point']} does not fit and was left out: {residual}"
            f"{point['w']:.1f} sigma",
            "check its coordinates and its image measurements",
        )


def _judge_rejected(figures: Mapping[str, Any]) -> Iterator[Finding]:
    counts = figures["counts"]
    share = counts["rejected"] / max(1, counts["rejected"] + counts["image_observations"])
    if share > MANY_REJECTED:
        yield ranked(
            IMAGE,
            share / MANY_REJECTED,
            f"{100 * share:.0f} % of the image observations were rejected as gross errors",
            "see adjust.json for images and points",
        )


def _mounting(figures: Mapping[str, Any], instead: Sequence[Trial]) -> Iterator[Finding]:
    rivals = "".join(f"; {one.name} of {one.shown} looks alike" for one in instead)
    for name, estimate in figures["mounting"].items():
        value, sigma = np.array(estimate["value"]), np.array(estimate["sigma"])
        if (np.abs(value) > SIGNIFICANT_SIGMAS * sigma).any():
            factor, unit = screen_unit(estimate["unit"])
            values = " / ".join(f"{factor * v:+.3g}" for v in value)
            yield ranked(
                name,
                0.4,
                f"the {name} differs from that of the {estimate['stated_in']} by {values} {unit}"
                f" ({np.max(np.abs(value) / sigma):.0f} sigma)",
                "process the flight with --mounting mounting.toml to have it in every product"
                if estimate["stated_in"] == "flight file"
                else "the poses that are written have it already"
                + rivals * (name == CAMERA_LEVER_ARM),
            )


def _correlations(figures: Mapping[str, Any]) -> Iterator[Finding]:
    """The strongest pair of each remedy; coefficients of one polynomial are no finding."""
    named_remedies: set[str] = set()
    for pair in figures["correlations"]:
        strong = abs(pair["correlation"]) > STRONG_CORRELATION
        if not strong or pair["remedy"] in named_remedies or pair["remedy"] == NORMAL:
            continue
        named_remedies.add(pair["remedy"])
        yield ranked(
            "correlation",
            0.3,
            f"unknowns {pair['first']} and {pair['second']} are hardly told apart (correlation"
            f" {pair['correlation']:+.3f})",
            pair["remedy"],
        )


def _headline(figures: Mapping[str, Any], findings: tuple[Finding, ...]) -> str:
    """The most important thing: a contradiction, else the precision."""
    precision = precision_sentence(figures)
    wrong = [finding for finding in findings if finding.rank >= 1.0]
    return f"{wrong[0].sentence}; {precision}" if wrong else precision


def precision_sentence(figures: Mapping[str, Any]) -> str:
    """Return number and precision of the images, and what check points say."""
    sigma = np.median([image["sigma_m"] for image in figures["images"]], axis=0)
    angles = np.degrees(np.median([image["sigma_rad"] for image in figures["images"]], axis=0))
    text = (
        f"{len(figures['images'])} images: median sigmas of positions"
        f" {lengths([1e3 * x for x in sigma])} (E, N, U), tilt {max(angles[:2]):.2g} deg,"
        f" heading {angles[2]:.2g} deg"
    )
    if (points := figures["points"]["median_sigma_m"]) is not None:
        text += f"; object points {lengths([1e3 * x for x in points])}"
    checks = [c for c in figures["check_points"] if "difference_m" in c]
    if checks:
        rms = figures["check_points_together"]["rms_m"]
        sigma = np.sqrt(np.mean([np.square(c["sigma_m"]) for c in checks], axis=0))
        text += (
            f"; {len(checks)} check points {lengths([1e3 * x for x in rms])} rms"
            f" ({lengths([1e3 * x for x in sigma])} expected)"
        )
    if of_vehicle := headline_words(figures):
        text += f"; {of_vehicle}"
    return text
