"""The catalogue of conventions, and which of them explains a misfit."""

from itertools import chain

import numpy as np
import pytest

from insgnss.base.errors import DataError
from insgnss.geodesy.conventions import (
    BODY_SETS,
    CAMERA_SETS,
    XYZ,
    angles,
    exchanged_orders,
    lengths,
    orders,
    reversed_signs,
    time_scale,
)
from insgnss.geodesy.explain import Candidate, best_shift, explain
from insgnss.geodesy.rotation import vector_from_rotation

SIGMA = 0.02  # of the noise, in m and rad
POSITIONS = {
    one.words: one for one in chain(exchanged_orders(XYZ), reversed_signs(XYZ), lengths("x"))
}
SETS = {"opk": CAMERA_SETS, "pok": CAMERA_SETS, "ypr": CAMERA_SETS, "rpy": BODY_SETS}
ANGLES = {(key, one.words): one for key, sets in SETS.items() for one in angles(sets[key], sets)}


def block(seed, n=40):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (n, 3)) * [200.0, 150.0, 40.0] + 5.0


def noise(seed, shape):
    return SIGMA * np.random.default_rng([9, seed]).standard_normal(shape)


def rms(d):
    return float(np.sqrt((d**2).sum(axis=1).mean()))


def inverse(change):
    """The matrix that plants what a linear change undoes."""
    return np.linalg.inv(change(np.eye(3)))


def of_positions(truth, file):
    return explain(
        file,
        [Candidate(words, one.change) for words, one in POSITIONS.items()],
        lambda X: rms(X - truth),
        good=10.0 * SIGMA,
        floor=SIGMA,
    )


@pytest.mark.parametrize("words", POSITIONS)
def test_each_convention_of_positions_is_named_alone(words) -> None:
    """Oracle: the convention that was planted into positions with noise."""
    truth = block(1)
    file = truth @ inverse(POSITIONS[words].change) + noise(1, truth.shape)
    explanation = of_positions(truth, file if "metres" not in words else file - noise(1, (40, 3)))
    assert explanation is not None
    assert (explanation.best.statement, explanation.alike) == (words, ())


@pytest.mark.parametrize("key", ANGLES, ids=" ".join)
def test_each_convention_of_angles_is_named_alone(key) -> None:
    """Oracle: the convention that was planted into exact angles."""
    of, words = key
    sets = SETS[of]
    file = np.random.default_rng(3).uniform(-1.4, 1.4, (40, 3)) * (0.01 if "that" in words else 1.0)
    truth = ANGLES[key].change(file)

    def misfit(C):
        return rms(vector_from_rotation(C @ truth.swapaxes(1, 2)))

    candidates = [
        Candidate(one.words, lambda C, change=one.change: change(sets[of].take(C)))
        for one in angles(sets[of], sets)
    ]
    explanation = explain(sets[of].rotation(file), candidates, misfit, floor=1e-9)
    assert explanation is not None
    assert (explanation.best.statement, explanation.alike) == (words, ())


@pytest.mark.parametrize("seed", range(8))
def test_right_data_and_scattered_data_have_no_explanation(seed) -> None:
    """Oracle: nothing was planted; noise of centimetres, and so much that nothing is right."""
    truth = block(seed)
    assert of_positions(truth, truth + noise(seed, truth.shape)) is None
    assert of_positions(truth, truth + 5e3 * noise(seed, truth.shape)) is None


def test_two_that_cannot_be_told_apart_are_both_named() -> None:
    """Oracle: of points with y = 0 the sign of y is free."""
    truth = block(4)
    truth[:, 1] = 0.0
    explanation = of_positions(truth, truth * [1.0, 1.0, -1.0])
    assert explanation is not None
    named = {explanation.best.statement, *(one.statement for one in explanation.alike)}
    assert named == {"z with the other sign", "y and z with the other sign"}
    assert explanation.clauses().count(", or ") == 1


def shift_of(truth, file, n):
    """What explains rows that were joined, with each order judged on its rows."""
    return explain(
        (file, truth),
        [
            Candidate(
                str(k),
                lambda pair, one=one, other=other: (pair[0][one], pair[1][other]),
                same=lambda pair, one=one: (pair[0][one], pair[1][one]),
            )
            for k, one, other in orders(n)
        ],
        lambda pair: rms(pair[0] - pair[1]),
    )


@pytest.mark.parametrize("n", [5, 12, 40])
@pytest.mark.parametrize("k", [1, -2])
def test_shifted_and_reversed_rows_are_named(n, k) -> None:
    """Oracle: the shift that was planted, and the reversed order."""
    truth = block(5, n)
    file = np.roll(truth, -k, axis=0) + noise(5, truth.shape)
    assert shift_of(truth, file, n).best.statement == str(k)
    assert shift_of(truth, truth[::-1], n).best.statement == "None"


def test_no_order_is_judged_on_less_than_half_of_the_rows() -> None:
    """Oracle: counted; two of five rows that happen to fit say nothing."""
    for n in range(2, 30):
        shifts = [k for k, *_ in orders(n) if k is not None]
        assert all(2 * (n - abs(k)) >= n for k in shifts)
        assert shifts.count(1) == 1
    truth = block(6, 5)
    file = truth + 10.0 * block(7, 5)
    file[:2] = truth[3:]
    assert shift_of(truth, file, 5) is None


def test_rows_that_a_candidate_leaves_out_count_for_nothing() -> None:
    """Oracle: one row is wrong, and every candidate that leaves it out would fit."""
    misfit = np.array([0.1, 0.1, 0.1, 50.0])
    one = Candidate[np.ndarray]("three rows", lambda x: x[:3])
    assert explain(misfit, [one], lambda x: float(x.max())) is not None
    fair = Candidate("three rows", lambda x: x[:3], same=lambda x: x[:3])
    assert explain(misfit, [fair], lambda x: float(x.max())) is None


def test_absurd_sizes_and_needless_parameters_are_not_named() -> None:
    """Oracle: what was stated of the candidates; a refusal of the package is no fit."""

    def refusing(x):
        raise DataError("no")

    absurd = Candidate[float]("a scale of -999984 ppm", lambda x: 0.0, size=-99.0)
    simple = Candidate[float]("an exchange", lambda x: 1.0)
    fitted = Candidate[float]("a turn", lambda x: 0.9, parameters=1)
    assert explain(100.0, [absurd, Candidate("refusing", refusing)], float) is None
    explanation = explain(100.0, [absurd, fitted, simple], float)
    assert explanation is not None
    assert (explanation.best, explanation.alike) == (simple, ())
    assert explain(100.0, [simple], float, good=0.5) is None


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (18.02, "the 18 leap seconds between GPS time and UTC"),
        (-17.1, "the 17 leap seconds between GPS time and UTC"),
        (-604800.0, "1 GPS week: the GPS week of one file is wrong"),
        (7200.0, "a time zone of 2 h"),
        (7218.0, "a time zone of 2 h and leap seconds"),
    ],
)
def test_time_scales_are_named(seconds, words) -> None:
    """Oracle: by hand; other offsets are two clocks that disagree."""
    assert time_scale(seconds) == words
    assert [time_scale(s) for s in (0.0, 1.3, 17.5, 19.5, 100.0)] == [""] * 5


def test_a_shift_is_searched_in_finer_steps() -> None:
    """Oracle: the minimum of a parabola; nothing where no shift can be judged."""
    shift, left = best_shift(lambda s: (s - 12.34) ** 2 + 1.0, 30.0, 1.0, 0.1, 0.01)
    assert shift == pytest.approx(12.34, abs=1e-9)
    assert left == pytest.approx(1.0)
    assert best_shift(lambda s: np.inf, 30.0, 1.0) is None


def test_an_explanation_never_leaves_more_than_all_data_do() -> None:
    """Oracle: by hand: of the rows that it is judged on it takes nine tenths, and leaves more than
    the whole has."""
    one = Candidate[float]("c", lambda _: 3.0, same=lambda _: 40.0)
    assert explain(2.0, [one], lambda x: x) is None
    assert explain(4.0, [one], lambda x: x) is not None
