"""Names of sums of processes and the order of their parameters."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from insgnss.base.errors import InputError, UsageError
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov
from insgnss.noise.processes.composition import Composition, composition_of, families


@st.composite
def axes(draw):
    """An axis of a random sum of processes, none of them absent."""
    size = st.floats(min_value=1e-6, max_value=1e3)
    own = {
        name: draw(size)
        for name in ("white_noise", "quantization", "random_walk", "drift")
        if draw(st.booleans())
    }
    times = draw(st.lists(size, min_size=0 if own else 1, max_size=5))
    return AxisNoise(**own, gauss_markov=tuple(GaussMarkov(time, draw(size)) for time in times))


@pytest.mark.parametrize(
    ("text", "name", "parameters"),
    [
        (
            "WN+3GM",
            "WN+3GM",
            (
                "white_noise correlation_time_1 driving_noise_1 correlation_time_2 driving_noise_2"
                " correlation_time_3 driving_noise_3"
            ),
        ),
        (
            " rw + 2 gm+wn +QN",
            "QN+WN+2GM+RW",
            (
                "quantization white_noise correlation_time_1 driving_noise_1 correlation_time_2"
                " driving_noise_2 random_walk"
            ),
        ),
        (
            "GM+AR1+wn",
            "WN+2GM",
            "white_noise correlation_time_1 driving_noise_1 correlation_time_2 driving_noise_2",
        ),
        (
            "3*AR1()+WN()",
            "WN+3GM",
            (
                "white_noise correlation_time_1 driving_noise_1 correlation_time_2 driving_noise_2"
                " correlation_time_3 driving_noise_3"
            ),
        ),
        ("DR+1GM", "GM+DR", "correlation_time_1 driving_noise_1 drift"),
    ],
)
def test_a_sum_is_read_in_any_order_and_case(text, name, parameters):
    """Oracle: the sums written out by hand."""
    composition = Composition.parse(text)
    assert str(composition) == name
    assert composition.parameters == tuple(parameters.split())
    assert composition.size == len(composition.parameters)
    assert Composition.parse(str(composition)) == composition


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("WN+GN", "WN+GN: unknown process 'GN', did you mean 'GM'?"),
        ("NW+GM", "NW+GM: unknown process 'NW', did you mean 'WN'?"),
        ("WN+AR2", "WN+AR2: unknown process 'AR2', did you mean 'AR1'?"),
        ("WN+bias", "WN+bias: unknown process 'BIAS', known are QN, WN, GM, RW, DR"),
        ("WN+GM+WN", "WN+GM+WN: WN stands 2 times"),
        ("2RW", "2RW: RW stands 2 times"),
        ("WN+4GM+2GM", "WN+4GM+2GM: 6 Gauss-Markov processes, the most is 5"),
        ("WN+0GM", "WN+0GM: 0 GM; leave out what is absent"),
        ("WN+", "'WN+': a process is missing"),
        ("", "'': a process is missing"),
    ],
)
def test_a_typo_is_refused_in_one_line_that_names_the_nearest(text, message):
    """Oracle: the messages a user should get."""
    with pytest.raises(UsageError, match=re.escape(message)) as caught:
        Composition.parse(text)
    assert "\n" not in str(caught.value)


@given(axes())
def test_parameters_and_axis_are_inverse(axis):
    """Oracle: the round trip, with Gauss-Markov processes sorted by hand."""
    composition = composition_of(axis)
    values = composition.values(axis)
    times = values[[name.startswith("correlation_time") for name in composition.parameters]]
    assert_array_equal(times, np.sort([p.correlation_time_s for p in axis.gauss_markov]))
    back = composition.axis(values)
    assert_array_equal(composition.values(back), values)
    assert {(p.correlation_time_s, p.driving_noise) for p in back.gauss_markov} == {
        (p.correlation_time_s, p.driving_noise) for p in axis.gauss_markov
    }


def test_processes_are_put_in_order_of_their_times():
    """Oracle: two processes swapped by hand."""
    composition = Composition.parse("WN+2GM")
    axis = composition.axis([0.1, 50.0, 2.0, 3.0, 4.0])
    assert axis == AxisNoise(
        white_noise=0.1, gauss_markov=(GaussMarkov(3.0, 4.0), GaussMarkov(50.0, 2.0))
    )


@pytest.mark.parametrize(
    ("largest", "count"), [("WN+3GM", 7), ("QN+WN+2GM+RW", 23), ("QN+WN+5GM+RW+DR", 95), ("DR", 1)]
)
def test_the_family_holds_every_smaller_sum_once(largest, count):
    """Oracle: the count, 2^(processes without a time) x (Gauss-Markov processes + 1) - 1."""
    family = families(Composition.parse(largest))
    assert len(family) == len(set(family)) == count
    assert Composition.parse(largest) in family
    assert [c.size for c in family] == sorted(c.size for c in family)


def test_wrong_values_are_refused():
    """Oracle: the error classes and their one line."""
    composition = Composition.parse("WN+GM")
    with pytest.raises(UsageError, match="2 values for the 3 parameters of WN\\+GM"):
        composition.axis([0.1, 2.0])
    with pytest.raises(InputError, match=r"white_noise -0\.1"):
        composition.axis([-0.1, 2.0, 3.0])
    with pytest.raises(UsageError, match="random_walk, 0 Gauss-Markov processes is not of WN\\+GM"):
        composition.values(AxisNoise(white_noise=1.0, random_walk=1.0))
    with pytest.raises(UsageError, match="without any process"):
        composition_of(AxisNoise(turn_on_bias=1.0))
    with pytest.raises(UsageError, match="7 Gauss-Markov processes; give from 0 to 5"):
        Composition(gauss_markov=7)
