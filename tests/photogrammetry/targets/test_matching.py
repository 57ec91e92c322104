"""The matching's derivatives by central differences, and images of one point against each other."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.photogrammetry.target_measurement import windows as windows_module
from insgnss.photogrammetry.target_measurement.products import _across, target_sizes
from insgnss.photogrammetry.target_measurement.request import Target
from insgnss.photogrammetry.target_measurement.trials import _trials
from insgnss.photogrammetry.targets import measurement
from insgnss.photogrammetry.targets.matching import (
    _design,
    _first_shadow,
    _light,
    _Shape,
    match,
)
from insgnss.photogrammetry.targets.signals import disc, quadrants
from insgnss.photogrammetry.targets.template import Template

TEMPLATE = Template(disc(0.2), np.array([[42.0, 6.0], [-4.0, 38.0]]))
SHADOW = np.array([0.6, 0.7, 1.3])


def state(shadow=None) -> _Shape:
    M = np.array([[1.02, 0.03], [-0.02, 0.97]])
    return _Shape(np.array([20.3, 19.6]), M, math.log(0.8), np.array([20.0, 20.0]), shadow)


def pixels(reach: float = 6.0) -> np.ndarray:
    v, u = np.mgrid[:40, :40]
    x = np.stack([u.ravel() + 0.5, v.ravel() + 0.5], axis=1)
    return x[np.hypot(*(x - 20.0).T) < reach]


def test_light_of_a_shadow_and_its_derivatives() -> None:
    """Oracle: scipy's normal distribution across the rim; central differences by share, direction
    and distance."""
    from scipy.stats import norm

    x = pixels()
    light, by = _light(x, state(SHADOW))
    across = (x - 20.0) @ [math.cos(0.7), math.sin(0.7)] - 1.3
    assert_allclose(light, 1.0 - 0.6 * norm.cdf(across / math.hypot(0.8, 0.3)), atol=1e-12)
    for k in range(3):
        step = np.zeros(3)
        step[k] = 1e-5
        numeric = _light(x, state(SHADOW + step))[0] - _light(x, state(SHADOW - step))[0]
        assert_allclose(by[:, k], numeric / 2e-5, atol=1e-7)
    assert _light(x, state())[1].shape == (len(x), 0)


def test_derivatives_of_the_template() -> None:
    """Oracle: central differences of the template's column by centre and deformation, over a cell
    of its grid; a turn, which a disc does not show, is none of them."""
    x, one = pixels(), state()
    light = np.ones(len(x))
    T, by = _design(x, TEMPLATE, one, 8.0, light)
    assert_allclose(T[:, 1:3], (x - one.c) / 8.0)
    assert_allclose(T[:, 4:6], T[:, 3:4] * (x - one.c) / 8.0)
    for k in range(6):
        moved, h = [], 0.2 if k < 2 else 0.03
        for sign in (1.0, -1.0):
            c, M = one.c.copy(), one.M.copy()
            if k < 2:
                c[k] += sign * h
            else:
                M.ravel()[k - 2] += sign * h
            moved.append(_design(x, TEMPLATE, replace(one, c=c, M=M), 8.0, light)[0][:, 3])
        numeric = (moved[0] - moved[1]) / (2.0 * h)
        assert_allclose(by[:, k], numeric, atol=0.1 * np.abs(numeric).max())
    assert np.abs(by[:, 2:6] @ TEMPLATE.turn).max() < 1e-9


def test_the_first_shadow_is_near_the_true_one() -> None:
    """Oracle: the rim that was drawn: direction within a step of 15 deg, distance within two
    pixels."""
    x, one = pixels(7.0), state()
    shadow = np.array([0.5, math.radians(60.0), 0.5])
    light = _light(x, state(shadow))[0]
    T = _design(x, TEMPLATE, one, 8.0, np.ones(len(x)))[0][:, 3]
    found = _first_shadow(x, light * (40.0 + 120.0 * T), TEMPLATE, one)
    assert abs(math.degrees(found[1]) - 60.0) <= 15.0
    assert abs(found[2] - 0.5) < 2.0


@pytest.mark.parametrize("shaded", [False, True])
def test_a_drawn_target_is_found_where_it_was_drawn(shaded) -> None:
    """Oracle: a template drawn by the module's own camera at a known place, size, blur, contrast
    and shade."""
    template = Template(quadrants(0.5), np.array([[42.0, 3.0], [-3.0, 42.0]]))
    v, u = np.mgrid[:60, :60]
    x = np.stack([u.ravel() + 0.5, v.ravel() + 0.5], axis=1)
    true = _Shape(np.array([30.4, 29.7]), 1.02 * np.eye(2), math.log(0.7), np.array([30.0, 30.0]))
    true.shadow = np.array([0.5, 0.4, 2.0]) if shaded else None
    light = _light(x, true)[0]
    column = _design(x, template, true, 8.0, light)[0]
    image = (30.0 * column[:, 0] + 150.0 * column[:, 3]).reshape(60, 60)
    got = match(image, template, np.array([30.0, 30.0]), shadow=shaded)
    assert got is not None
    assert got.converged
    assert_allclose(got.uv, true.c, atol=0.02)
    assert got.contrast == pytest.approx(150.0, rel=0.03)
    assert got.blur_px == pytest.approx(0.7, rel=0.1)
    assert got.correlation > 0.99
    assert got.shade == pytest.approx(0.5 if shaded else 0.0, abs=0.03)
    if not shaded:
        assert_allclose(got.M, true.M, atol=5e-3)


@pytest.mark.parametrize(
    ("tilt_deg", "heading_deg"), [(0.0, 0.0), (30.0, 20.0), (30.0, 110.0), (50.0, -60.0)]
)
def test_the_apparent_size_of_a_disc(tilt_deg, heading_deg) -> None:
    """Oracle: (GT.7) by projecting the ends of the diameter that is parallel to the image; an
    image of a template that is 2 % larger says so."""
    f, depth, length = 3000.0, 50.0, 0.6
    tilt, heading = math.radians(tilt_deg), math.radians(heading_deg)
    axis = np.array(
        [math.sin(tilt) * math.cos(heading), math.sin(tilt) * math.sin(heading), -math.cos(tilt)]
    )
    right = _across(axis)
    assert right @ axis == pytest.approx(0.0, abs=1e-12)
    assert right[2] == 0.0
    C = np.column_stack([right, np.cross(axis, right), axis])
    centre = depth * axis + 2.0 * right

    def pixel(X):
        q = C.T @ X
        return f * q[:2] / q[2]

    h = 1e-3
    by_point = np.array(
        [(pixel(centre + e) - pixel(centre - e)) / (2 * h) for e in h * np.eye(3)]
    ).T
    M = np.eye(2) / 1.02
    to_pixel = np.linalg.solve(M, by_point[:, :2])
    found = SimpleNamespace(to_pixel=to_pixel, M=M, M_cov=1e-8 * np.eye(4), edge_px=0.01)
    window = SimpleNamespace(row=0, measurement=SimpleNamespace(match=found, accepted=True))
    one = np.zeros(1, dtype=int)
    inputs = SimpleNamespace(
        predictions=SimpleNamespace(image=one, point=one, by_point=by_point[None]),
        request=SimpleNamespace(target=SimpleNamespace(size_m=length)),
        eo=SimpleNamespace(C_mc=C[None], position_m=np.zeros((1, 3)), images=("a.jpg",)),
        ground=SimpleNamespace(position_m=centre[None], points=("P",)),
        camera=SimpleNamespace(of=lambda _: f),
    )
    sizes = target_sizes(inputs, [window])
    ends = pixel(centre + 0.5 * length * right) - pixel(centre - 0.5 * length * right)
    assert sizes.size_px[0] == pytest.approx(1.02 * np.linalg.norm(ends), rel=1e-3)
    assert sizes.sigma_px[0] > math.sqrt(2.0) * 0.01
    assert sizes.sigma_px[0] < 0.05
    window.measurement.accepted = False
    assert target_sizes(inputs, [window]).size_px.size == 0


@pytest.mark.parametrize(("images", "checked"), [(2, False), (3, True)])
def test_three_images_hold_each_other(monkeypatch, images, checked) -> None:
    """Oracle: by hand: one of three that is off by what no error explains is rejected, with the
    point's own error taken off its prediction; two cannot tell."""
    seen = []

    def disagreeing(off, cov, B, P):
        seen.append((off, cov))
        return np.array([np.nan] * (len(off) - 1) + [9.0])

    monkeypatch.setattr(windows_module, "disagreeing", disagreeing)
    B = np.arange(6.0).reshape(2, 3) + np.zeros((images, 2, 3))
    P = np.diag([0.01, 0.02, 0.03])
    predictions = SimpleNamespace(
        point=np.zeros(images, int),
        uv=np.full((images, 2), 5.0),
        by_point=B,
        cov=np.tile(100.0 * np.eye(2), (images, 1, 1)),
    )
    inputs = SimpleNamespace(
        predictions=predictions, ground=SimpleNamespace(points=("P",), cov=P[None])
    )
    monkeypatch.setattr(
        windows_module, "replace", lambda one, **new: SimpleNamespace(**{**vars(one), **new})
    )
    found = SimpleNamespace(uv=np.array([6.0, 7.0]), cov=0.5 * np.eye(2))
    windows = [
        SimpleNamespace(row=k, measurement=SimpleNamespace(match=found, accepted=True, rejected=""))
        for k in range(images)
    ]
    out = list(windows_module._held_together(inputs, windows))
    assert bool(seen) is checked
    assert bool(out[-1].measurement.rejected) is checked
    assert not out[0].measurement.rejected
    if seen:
        assert_allclose(seen[0][0], np.tile([1.0, 2.0], (3, 1)))
        assert_allclose(seen[0][1][0], 100.5 * np.eye(2) - B[0] @ P @ B[0].T)


def test_what_is_tried_where_nothing_is_found() -> None:
    """Oracle: by hand: a wider search, the other brightness where there are two, other sizes."""
    tried = list(_trials(Target("cross", 0.5, arm_m=0.1)))
    assert [words for words, *_ in tried] == [
        *("--search-px 10", "--search-px 30", "--dark"),
        *("--size 0.25", "--size 0.333", "--size 0.75", "--size 1"),
    ]
    assert [wider for *_, wider in tried] == [10.0, 30.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert_allclose([target.arm_m for _, target, _ in tried[3:]], [0.05, 0.1 / 1.5, 0.15, 0.2])
    assert [words for words, *_ in _trials(Target("quadrants", 0.5))][2] == "--size 0.25"


@pytest.mark.parametrize(
    ("plain", "shaded", "chosen"),
    [
        ((0.996, True), (0.999, True), "plain"),  # clear, so that no shadow is looked for
        ((0.74, True), (0.999, True), "plain"),  # too poor for a shadow to be all
        ((0.76, True), (0.999, True), "shaded"),
        ((0.90, True), (0.945, True), "shaded"),  # leaves less than six tenths
        ((0.90, True), (0.940, True), "plain"),
        ((0.90, False), (0.91, True), "shaded"),
        ((0.90, True), (0.999, False), "plain"),
    ],
)
def test_when_a_shadow_is_taken(monkeypatch, plain, shaded, chosen) -> None:
    """Oracle: by hand: 1 - r^2 of both, a correlation of 0.75, the clear one of the rules."""

    def match_(window, template, uv, blur_px, freedom, shadow):
        correlation, converged = shaded if shadow else plain
        one = SimpleNamespace(
            correlation=correlation, converged=converged, uv=np.zeros(2), shade=float(shadow)
        )
        one.moved_by = lambda _: one
        return one

    monkeypatch.setattr(measurement, "match", match_)
    peak = SimpleNamespace(template=SimpleNamespace(reach_px=8.0), uv=np.zeros(2))
    rules = replace(measurement.Rules(), clear=0.995)
    best = measurement._best(np.zeros((9, 9)), (0, 0), [peak], rules)
    assert best is not None
    assert best[1].shade == (1.0 if chosen == "shaded" else 0.0)
