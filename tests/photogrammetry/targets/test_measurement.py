"""Targets measured in rendered images.

Oracle: the pixel of the ground point, which the renderer knows; it draws by rays with perspective
(`rendered`) and shares nothing with the templates. Bars: 0.1 to 0.2 px rms, errors over sigmas 0.7
to 1.5, nothing measured where nothing lies.
"""

import re
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from rendered_targets import Scene, bars, board, camera, plate

from insgnss.base.errors import InputError
from insgnss.photogrammetry.targets.matching import Freedom
from insgnss.photogrammetry.targets.measurement import MeasuredTarget, Rules, deformation, measure
from insgnss.photogrammetry.targets.prediction import predict
from insgnss.photogrammetry.targets.signals import Signal, cross, disc, picture, quadrants
from insgnss.photogrammetry.targets.template import Template, rotated_axes

Array = NDArray[np.float64]
KINDS = {
    "quadrants": (board(0.3), quadrants(0.3)),
    "disc": (plate(0.2, 0.45), disc(0.2)),
    "cross": (bars(0.5, 0.08), cross(0.5, 0.08)),
}


@dataclass
class Taken:
    """Errors, and errors by their standard deviations, (n, 2), of what was accepted; all else."""

    errors: Array
    normalised: Array
    rejected: list[MeasuredTarget]


def taken(
    kind: str,
    count: int,
    seed: int,
    missing: bool = False,
    shadow: bool = False,
    off: float = 3.0,
    cover: str = "",
    developed: bool = False,
) -> Taken:
    """Targets of all azimuths, blurs of 0.4 to 1.1 px, noise of 1 to 6 of 256 grey values."""
    rng = np.random.default_rng(seed)
    pattern, signal = KINDS[kind]
    errors, normalised, rejected = [], [], []
    for _ in range(count):
        scene = Scene(rng)
        image = scene.image(
            None if missing else pattern,
            rng.uniform(0, 2 * np.pi),
            rng.uniform(0.4, 1.1),
            rng.uniform(1, 6),
            shadow,
            cover=cover,
            developed=developed,
        )
        got = measure(
            image,
            signal,
            scene.uv + off * rng.normal(size=2),
            off**2 * np.eye(2),
            _by_point(scene),
        )
        if got.match is None or not got.accepted:
            rejected.append(got)
            continue
        errors.append(got.match.uv - scene.uv)
        normalised.append(np.linalg.solve(np.linalg.cholesky(got.match.cov), errors[-1]))
    return Taken(np.array(errors).reshape(-1, 2), np.array(normalised).reshape(-1, 2), rejected)


def _by_point(scene: Scene) -> Array:
    seen = predict(
        camera(),
        scene.X0[None],
        scene.C[None],
        np.zeros((1, 6, 6)),
        np.zeros((1, 3)),
        1e-4 * np.eye(3)[None],
    )
    np.testing.assert_allclose(seen.uv[0], scene.uv, atol=1e-6)
    return np.asarray(seen.by_point[0])


def rms(a: Array) -> float:
    return float(np.sqrt(np.mean(a**2)))


@pytest.mark.parametrize("kind", KINDS)
def test_targets_are_found_to_a_tenth_of_a_pixel(kind: str) -> None:
    """Oracle: the renderer; 10 coordinates, whose scatter spreads by a quarter."""
    got = taken(kind, 5, 21)
    assert not got.rejected
    assert rms(got.errors) < 0.1
    assert 0.5 < rms(got.normalised) < 1.8


def test_nothing_is_found_where_nothing_lies() -> None:
    """Oracle: roofs, roads and texture without a target, over a window of 60 px."""
    got = taken("quadrants", 3, 22, missing=True, off=8.0)
    assert [m.rejected == "" for m in got.rejected] == [False] * 3


@pytest.mark.slow
def test_the_rim_of_a_shadow_is_no_edge_of_the_target() -> None:
    """Oracle: the renderer; a shadow that takes 55 % of the light of a part of the target, before
    the image is blurred. Errors are those of the covariance, which has no floor for shadows.
    """
    got = taken("quadrants", 8, 23, shadow=True)
    assert len(got.errors) >= 6
    assert rms(got.errors) < 0.1
    assert rms(got.normalised) < 1.6


def test_a_disc_of_which_a_part_is_covered_is_less_certain_by_what_it_is_off() -> None:
    """Oracle: a disc without its easternmost 25 mm, by hand: its middle moves by some 0.6 px."""

    def cut(e: Array, n: Array) -> Array:
        return np.where((e > 0.075) & (np.hypot(e, n) < 0.2), 50.0, plate(0.2, 0.45)(e, n))

    for seed in range(3):
        scene = Scene(np.random.default_rng(seed))
        got = measure(scene.image(cut), disc(0.2), scene.uv, np.eye(2), _by_point(scene))
        assert got.match is not None
        error = got.match.uv - scene.uv
        assert np.hypot(*error) > 0.2
        assert error @ np.linalg.solve(got.match.cov, error) < 9.0
        assert np.linalg.eigvalsh(got.match.cov)[-1] < 1.0


def test_noise_takes_nothing_from_the_correlation() -> None:
    """Oracle: the renderer; noise of a sixth of the contrast, with which the plain coefficient is
    below 0.95, and errors that the covariance explains.
    """
    rng, sizes = np.random.default_rng(9), []
    for _ in range(6):
        scene = Scene(rng)
        image = scene.image(board(0.3, 100.0, 148.0), noise=8.0, structured=False)
        got = measure(image, quadrants(0.3), scene.uv + 1.0, np.eye(2), _by_point(scene))
        assert got.match is not None
        assert got.accepted, got.rejected
        error = got.match.uv - scene.uv
        sizes.append(np.linalg.solve(np.linalg.cholesky(got.match.cov), error))
    assert 0.5 < rms(np.array(sizes)) < 1.6


def test_ground_that_is_steep_deforms_a_target_seen_from_the_side() -> None:
    """Oracle: the plane through the point, drawn by hand: pixels G + g s^T by metres."""
    B = np.array([[50.0, 0.0, 25.0], [0.0, -50.0, 10.0]])
    s = np.array([0.2, -0.1])
    template = Template(quadrants(0.3), rotated_axes(B, 0.0), B[:, 2])
    steep = B[:, :2] + np.outer(B[:, 2], s)
    M = B[:, :2] @ np.linalg.inv(steep)
    assert deformation(M, Freedom().deformation(template)) < 1.2
    level = Template(quadrants(0.3), rotated_axes(B, 0.0))
    assert deformation(M, Freedom().deformation(level)) > 1.5


def test_a_picture_of_the_target_serves_as_well() -> None:
    """Oracle: the renderer; the azimuth is given, as two turns look alike."""
    at = (np.arange(60) + 0.5) / 60.0 - 0.5
    e, n = np.meshgrid(at, -at)
    shown = picture(((e > 0) == (n > 0)) * 100.0 + 20.0, 0.3)
    scene = Scene(np.random.default_rng(5))
    image = scene.image(board(0.3), azimuth=0.3)
    got = measure(image, shown, scene.uv + 2.0, 4.0 * np.eye(2), _by_point(scene), azimuth_rad=0.3)
    assert got.match is not None
    assert got.accepted, got.rejected
    assert np.abs(got.match.uv - scene.uv).max() < 0.15


def _one(signal: Signal, where: Array | None = None, rules: Rules | None = None) -> MeasuredTarget:
    scene = Scene(np.random.default_rng(6))
    image = scene.image(board(0.3), structured=False)
    at = scene.uv if where is None else where
    return measure(image, signal, at, np.eye(2), _by_point(scene), rules=rules)


def test_a_rejection_names_the_rule_and_its_number() -> None:
    """Oracle: rules that the good target must break one at a time."""
    assert _one(quadrants(0.3)).accepted
    for rules, words in (
        (Rules(found=0.999), "of the search, below 0.999"),
        (Rules(correlation=0.99999), "below 0.99999"),
        (Rules(contrast=1e6), "sigmas of a grey value, below"),
        (Rules(sigma_px=1e-4), "sigma .* px, above 0.0001"),
        (Rules(moved=1e-4), "px from its place, above"),
        (Rules(deformed=1e-4), "deformed .* sigmas, above"),
        (Rules(ambiguous=2.0), "a second place"),
    ):
        got = _one(quadrants(0.3), rules=rules)
        assert not got.accepted
        assert re.search(words, got.rejected), got.rejected
    assert "too small" in _one(quadrants(0.1)).rejected
    for at in (np.array([3.0, 48.0]), np.array([-500.0, 48.0]), np.array([9000.0, 48.0])):
        assert "leave the image" in _one(quadrants(0.3), at).rejected


def test_wrong_arrays_are_refused() -> None:
    """Oracle: the message."""
    B = np.array([[50.0, 0.0, 0.0], [0.0, -50.0, 0.0]])
    with pytest.raises(InputError, match="grey values"):
        measure(np.zeros((9, 9, 3)), quadrants(0.3), [4, 4], np.eye(2), B)
    with pytest.raises(InputError, match="not finite"):
        measure(np.zeros((9, 9)), quadrants(0.3), [np.nan, 4], np.eye(2), B)
    flat = measure(np.full((90, 90), 7), quadrants(0.3), [45, 45], np.eye(2), B)
    assert "correlation 0.00 of the search" in flat.rejected
