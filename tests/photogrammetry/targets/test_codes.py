"""Numbers of ring-coded targets.

Oracle: rings drawn by rays with a number (`rendered_targets`), read about their true centre.
"""

import numpy as np
import pytest
from rendered_targets import Scene, ringed

from insgnss.base.errors import InputError
from insgnss.photogrammetry.targets.codes import LEAST_CLEAR, Ring, read_ring, smallest


def to_pixel(scene: Scene) -> np.ndarray:
    """Pixels by metres east and north, by differences of the renderer's rays."""
    step = np.eye(2)
    at = [np.stack(scene.on_ground(scene.uv + s)) - scene.on_ground(scene.uv - s) for s in step]
    return np.linalg.inv(np.stack(at, axis=1) / 2.0)


@pytest.mark.parametrize("shadow", [False, True])
def test_a_ring_says_its_number_in_any_azimuth(shadow: bool) -> None:
    """Oracle: the number that was drawn; what is clear is right, and most are clear."""
    rng, clear = np.random.default_rng(4), 0
    for _ in range(10):
        scene, number = Scene(rng), int(rng.integers(1, 2**12 - 1))
        image = scene.image(ringed(0.2, 12, number), rng.uniform(0, 2 * np.pi), shadow=shadow)
        got = read_ring(image, Ring(0.2), scene.uv, to_pixel(scene))
        assert got is not None
        if got.clear >= LEAST_CLEAR:
            clear += 1
            assert got.number == smallest([bool(number >> (11 - k) & 1) for k in range(12)])
    assert clear >= (7 if shadow else 10)


def test_what_is_no_ring_says_nothing() -> None:
    """Oracle: by hand; beyond the image, of one grey value, and rings that cannot be."""
    G = np.array([[50.0, 0.0], [0.0, -50.0]])
    assert read_ring(np.zeros((96, 96)), Ring(0.2), [3.0, 48.0], G) is None
    assert read_ring(np.full((96, 96), 7.0), Ring(0.2), [48.0, 48.0], G) is None
    for wrong in ((0.2, 3), (0.2, 12, 1.0, 3.0), (0.2, 12, 3.0, 2.0)):
        with pytest.raises(InputError, match="4 to 32 segments"):
            Ring(*wrong)
