"""IMU axes in words against hand-written directions and the properties of rotations."""

import itertools

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from insgnss.base.errors import InputError
from insgnss.geodesy.axes import parse_axes

VECTORS = {
    "forward": (1, 0, 0),
    "backward": (-1, 0, 0),
    "right": (0, 1, 0),
    "left": (0, -1, 0),
    "down": (0, 0, 1),
    "up": (0, 0, -1),
}


def _triples(handedness):
    """Triples of words along three different lines whose triple product has the sign asked for."""
    for words in itertools.permutations(VECTORS, 3):
        x, y, z = (np.array(VECTORS[word]) for word in words)
        if np.dot(np.cross(x, y), z) == handedness:
            yield words


def test_all_24_right_handed_triples_are_read():
    """Oracle: directions written by hand and the triple product x cross y dot z = 1."""
    triples = list(_triples(+1))
    assert len(triples) == 24
    for words in triples:
        C_b_imu = parse_axes(" ".join(words))
        for axis, word in zip(np.eye(3), words, strict=True):
            assert_array_equal(C_b_imu @ axis, VECTORS[word])


def test_front_right_down_body_from_a_right_forward_up_sensor():
    """Oracle: the FRD-RFU matrix S of the conventions, [[0, 1, 0], [1, 0, 0], [0, 0, -1]]."""
    assert_array_equal(parse_axes("right forward up"), [[0, 1, 0], [1, 0, 0], [0, 0, -1]])


def test_raw_navchip_axes():
    """Oracle: hand calculation. Sensor x right, y backward, z down: gravity stays on z, a forward
    push shows on -y.
    """
    C_b_imu = parse_axes("Right, back, DOWN")
    assert_array_equal(C_b_imu @ [0, 0, 1], [0, 0, 1])
    assert_array_equal(C_b_imu @ [0, -1, 0], [1, 0, 0])


def test_every_left_handed_triple_is_refused_with_a_right_handed_one():
    """Oracle: triple product; the suggestion must itself be one of the 24 and keep x and y."""
    right_handed = {" ".join(words) for words in _triples(+1)}
    for words in _triples(-1):
        with pytest.raises(InputError, match="left-handed") as refusal:
            parse_axes(" ".join(words))
        suggestion = str(refusal.value).rsplit("'", 2)[1]
        assert suggestion in right_handed
        assert suggestion.split()[:2] == list(words[:2])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("forward forward down", "right or left is missing"),
        ("forward back down", "one line and right or left is missing"),
        ("up down up", "forward or backward and right or left is missing"),
        ("forward right", "2 directions, expected 3"),
        ("forward right down up", "4 directions, expected 3"),
        ("", "0 directions"),
        ("forwrd right down", "did you mean 'forward'"),
        ("x y z", "known are forward, backward"),
    ],
)
def test_wrong_words_are_refused(words, says):
    """Oracle: the reason written by hand."""
    with pytest.raises(InputError, match=says):
        parse_axes(words)
