"""The judge of the fault campaign (scripts/fault_campaign.py), on errors whose distribution is
known.
"""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from insgnss.records import ExteriorOrientation

SCRIPT = Path(__file__).parents[2] / "scripts" / "fault_campaign.py"


@pytest.fixture(scope="module")
def campaign():
    spec = importlib.util.spec_from_file_location("fault_campaign", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    import sys

    sys.modules["fault_campaign"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    yield module
    del sys.modules["fault_campaign"]


def chain(n: int, rho: float) -> ExteriorOrientation:
    """n images whose errors are a first-order autoregression with the correlation rho of
    neighbours, six components alike.
    """
    cov = np.broadcast_to(np.diag([4.0, 1.0, 9.0, 1e-4, 1e-4, 1e-2]), (n, 6, 6))
    return ExteriorOrientation(
        tuple(str(k) for k in range(n)),
        np.arange(n, dtype=float),
        2008,
        np.zeros(3),
        np.zeros((n, 3)),
        np.broadcast_to(np.eye(3), (n, 3, 3)),
        cov,
        rho * cov[1:],
        np.eye(3),
        np.eye(3),
    )


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9, 1.0])
def test_effective_samples_of_an_autoregression(campaign, rho):
    """Oracle: closed form, n^2 / sum over i, j of rho^(2 |i - j|); n of them without correlation,
    one with a whole one.
    """
    n = 30
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    expected = n * n / (rho ** (2.0 * lag) if rho else (lag == 0)).sum()
    np.testing.assert_allclose(campaign.effective_samples(chain(n, rho)), expected, rtol=1e-12)


def run_of(campaign, rng, scale=1.0, n=40):
    z = scale * rng.standard_normal((n, 6))
    return campaign.Run("done", "", z, (z**2).sum(axis=1), np.full(6, float(n)), np.full(6, 0.01))


def test_verdicts_follow_the_errors(campaign):
    """Oracle: errors drawn as large as, half and three times as large as claimed, and one single
    image far off.
    """
    rng = np.random.default_rng(0)
    case, one = campaign.Case("x"), np.ones(6)

    def word(*runs):
        return campaign.conclude(case, list(runs), one).word

    assert word(*(run_of(campaign, rng) for _ in range(5))) == "covered"
    assert word(*(run_of(campaign, rng, 0.5) for _ in range(5))).startswith("covered, wide")
    assert word(*(run_of(campaign, rng, 1.3) for _ in range(5))) == "FAILED"
    assert word(campaign.Run("stopped", "why"), campaign.Run("stopped", "why")) == "stopped"
    assert word(campaign.Run("stopped", "why"), run_of(campaign, rng)) == "covered"
    assert word(campaign.Run("defect", "oh"), run_of(campaign, rng)) == "FAILED"
    far = run_of(campaign, rng)
    far.nees[7] = 60.0
    assert word(far) == "FAILED"
    assert (
        campaign.conclude(campaign.Case("x", beyond="no trace"), [far], one).word
        == "not covered, no trace"
    )


def test_honest_verdicts_are_rarely_failures(campaign):
    """Oracle: the error rate that the bounds claim, 1 % for the means and 1 % for the worst image;
    300 cases, four sigma of binomial.
    """
    rng = np.random.default_rng(1)
    words = [
        campaign.conclude(
            campaign.Case("x"), [run_of(campaign, rng) for _ in range(4)], np.ones(6)
        ).word
        for _ in range(300)
    ]
    assert sum(word != "covered" for word in words) / 300 < 0.02 + 4.0 * np.sqrt(0.02 / 300)


@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_the_confirmed_share_is_that_of_what_images_share(campaign, scale):
    """Oracle: closed form: half of the images a copy of the others halves the samples, whatever the
    size of the errors; 400 runs, 10 %.
    """
    rng = np.random.default_rng(3)
    single = [run_of(campaign, rng, scale, 20) for _ in range(400)]
    doubled = [
        campaign.Run(
            "done", "", np.vstack([run.z, run.z]), np.tile(run.nees, 2), 2.0 * run.n_eff, run.rms
        )
        for run in single
    ]
    np.testing.assert_allclose(
        campaign.confirmed_share([single[:200], single[200:]]), 1.0, atol=0.15
    )
    np.testing.assert_allclose(campaign.confirmed_share([doubled]), 0.5, atol=0.08)


def test_a_row_says_how_the_runs_ended(campaign):
    """Oracle: the counts, and the reason of the first that stopped."""
    rng = np.random.default_rng(2)
    runs = [run_of(campaign, rng), campaign.Run("stopped", "DataError: a | b")]
    row = campaign.conclude(campaign.Case("gap"), runs, np.ones(6)).row()
    assert row.startswith("| gap | 1 / 1 / 0 |")
    assert row.endswith("| covered; of the others: DataError: a / b |")
    assert row.count("|") == 8


def test_a_traceback_is_a_defect_and_an_error_a_stop(campaign, monkeypatch):
    """Oracle: exceptions raised on purpose in place of the main job."""
    from insgnss.base.errors import DataError

    options = {"flight": campaign.LONG.changed(minutes=0.4)}
    for error, exit_ in (
        (ZeroDivisionError("no"), "defect"),
        (DataError("/tmp/x/imu.csv:8: gap"), "stopped"),
    ):

        def fail(_flight, error=error):
            raise error

        monkeypatch.setattr(campaign, "process", fail)
        run = campaign.fly(options, 1)
        assert run.exit == exit_
    assert run.reason == "DataError: imu.csv:8: gap"
    assert campaign.fly(options | {"flight_file": {"filter": {"no_such": 1}}}, 1).exit == "defect"
