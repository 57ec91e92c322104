"""Which images can be used, for which need, and the reason in words."""

from dataclasses import replace

import numpy as np
import pytest

from insgnss.records import Check, MeanResidual, TimeCorrelatedError
from insgnss.report.rules.needs import NEEDS
from insgnss.report.sections import limits
from insgnss.report.summary import run_summary
from insgnss.report.verdict import run_verdict

FLIGHT = {"output": {"need": None, "need_m": None, "need_deg": None}}


def with_need(**need):
    """A resolved flight file that states a need."""
    return {"output": FLIGHT["output"] | need}


def test_a_good_flight_is_used_and_the_measure_is_named(diagnostics, eo, summary) -> None:
    """Oracle: by hand; 1.5 sigmas of a fix, in height with 20 mm of a phase centre that nobody
    stated, a good flight's tilt, ten median headings.
    """
    s = summary(diagnostics(), eo())
    assert (s["use"]["verdict"], s["use"]["images"], s["use"]["reasons"]) == ("use", [], [])
    assert s["use"]["need_m"] == pytest.approx([0.03, 0.03, 1.5 * np.hypot(0.03, 0.02)])
    assert s["use"]["need_deg"] == pytest.approx([0.05, 0.05, 0.2])
    assert s["use"]["measure"] == "receiver and IMU"
    assert s["headline"].startswith("Use it: 30 images")
    colour, why, _ = run_verdict(s)
    assert colour == "good"
    assert "known to 2.0 / 3.0 / 4.0 mm and 0.004 / 0.003 / 0.02 deg" in why
    assert "no need is stated, so 30.0 / 30.0 / 54.1 mm and 0.05 / 0.05 / 0.2 deg" in why


def test_the_usual_need_is_that_of_a_fix_in_the_axes_of_the_images(
    diagnostics, eo, summary
) -> None:
    """Oracle: sigmas 20, 24, 30 mm north, east, down, and a slow error of 10, 7, 40 mm: root sums
    of squares times 1.5, east first; one that few fixes have does not count, and a lever arm
    whose sigma is stated adds none in height.
    """
    sigma = np.broadcast_to([0.02, 0.024, 0.03], (1200, 3))
    share = (1.0, 1.0, 1.0)
    slow = TimeCorrelatedError(60.0, 1200, (0.01, 0.007, 0.04), share, share)
    few = TimeCorrelatedError(60.0, 500, (1.0, 1.0, 1.0), share, share)
    solved = diagnostics(innovation_sigma=sigma, time_correlated=(slow, few))
    s = summary(solved, eo(), mounting={"antenna_sigma_m": 0.005})
    need = 1.5 * np.hypot([0.024, 0.02, 0.03], [0.007, 0.01, 0.04])
    assert s["use"]["need_m"] == pytest.approx(need.tolist())


def test_an_image_beyond_its_need_is_named(diagnostics, eo, summary) -> None:
    """Oracle: the one image whose heading sigma was set."""
    s = summary(diagnostics(), eo(0.31))
    assert s["use"]["verdict"] == "except"
    assert s["use"]["images"] == ["8001.tif"]
    assert s["use"]["sentence"] == "Use it except 1 image (8001.tif)"
    assert s["use"]["reasons"][0].startswith("heading is known to 0.31 deg only, needed are 0.2")
    assert run_verdict(s)[0] == "doubtful"


def test_one_fault_of_several_images_is_one_sentence(diagnostics, eo, summary) -> None:
    """Oracle: heading sigmas of three images are 30 times as large; the reason names each once."""
    orientation = eo()
    cov = orientation.cov.copy()
    for k in (2, 5, 6):
        cov[k, 5, :] *= 30.0
        cov[k, :, 5] *= 30.0
    use = summary(diagnostics(), replace(orientation, cov=cov))["use"]
    names = [orientation.images[k] for k in (2, 5, 6)]
    assert use["images"] == names
    (reason,) = use["reasons"]
    assert f"in 3 images ({names[0]}, {names[1]} ... {names[2]})" in reason
    assert reason.count("heading is known") == 1


@pytest.mark.parametrize(
    ("need", "verdict"),
    [
        ({"need_m": (0.0021, 0.0031, 0.0041)}, "use"),
        ({"need_m": (0.0021, 0.0029, 0.0041)}, "no"),
        ({"need_deg": (0.0041, 0.0031, 0.021)}, "use"),
        ({"need_deg": (0.0041, 0.0031, 0.019)}, "no"),
        ({"need": "start values", "need_m": (0.0021, 0.0029, 0.0041)}, "no"),
        *(({"need": name}, "use") for name in NEEDS),
    ],
)
def test_a_stated_need_decides_component_by_component(
    diagnostics, eo, summary, need, verdict
) -> None:
    """Oracle: the sigmas of all images, 2, 3, 4 mm and 0.004, 0.003, 0.02 deg."""
    s = summary(diagnostics(), eo(), **with_need(**need))
    assert s["use"]["verdict"] == verdict
    assert s["use"]["measure"] == "stated"


def test_innovations_enlarge_the_sigmas_by_their_factor(diagnostics, eo, summary) -> None:
    """Oracle: (U.1) with k = 2: 6 mm north are within 6.3 and beyond 5.7."""
    for need, verdict in ((0.0063, "use"), (0.0057, "no")):
        s = summary(diagnostics(2.0), eo(), **with_need(need_m=(1.0, need, 1.0)))
        assert s["use"]["verdict"] == verdict
    assert "scatter 2.0 times as much" in s["use"]["reasons"][0]


def test_images_where_the_trajectory_leaves_its_fixes_are_named(diagnostics, eo, summary) -> None:
    """Oracle: the images within the piece of time, by hand; east is the second of N, E, D."""
    d = diagnostics()
    begin, end = float(d.time[290]), float(d.time[500])
    off = MeanResidual(begin, end, 210, (0.0, 0.4, 0.0), (0.01, 0.02, 0.03))
    s = summary(diagnostics(residuals=(off,)), eo())
    inside = [name for name, t in zip(eo().images, eo().time, strict=True) if begin <= t <= end]
    assert s["use"]["verdict"] == "except"
    assert s["use"]["images"] == inside
    assert "400 mm" in s["use"]["reasons"][0]
    wide = summary(diagnostics(residuals=(off,)), eo(), **with_need(need_m=(0.41, 0.1, 0.1)))
    assert wide["use"]["verdict"] == "use"


def test_images_near_a_covariance_reset_are_named(diagnostics, eo, summary) -> None:
    """Oracle: by hand; 30 s on both sides of it."""
    d = diagnostics()
    reset = float(d.time[700])
    s = summary(diagnostics(covariance_resets=np.array([reset])), eo())
    near = [n for n, t in zip(eo().images, eo().time, strict=True) if abs(t - reset) <= 30.0]
    assert (s["use"]["verdict"], s["use"]["images"]) == ("except", near)


def test_what_forbids_the_use_of_all_images_has_its_reason(diagnostics, eo, summary) -> None:
    """Oracle: by hand."""
    against = Check("axes, vertical", "turned by 180 deg", "down", "contradiction", "")
    cases = {
        "turned by 180 deg (expected: down)": diagnostics(checks=(against,)),
        "no GNSS position was used": diagnostics(used=np.zeros(1200, dtype=bool)),
    }
    for words, d in cases.items():
        s = summary(d, eo())
        assert s["use"]["verdict"] == "no"
        assert words in run_verdict(s)[1]
        assert run_verdict(s)[0] == "bad"


@pytest.mark.parametrize("name", ["exposure clock", "GNSS swing"])
def test_a_question_that_no_data_answer_holds_all_images_back(
    name, diagnostics, eo, summary
) -> None:
    """Oracle: by hand; the answer is in the flight file, so nothing is forbidden, and an accepted
    one holds nothing back.
    """
    asks = Check(name, "by the other clock 2 m elsewhere", "-", "note", "say it")
    accepted = summary(diagnostics(checks=(asks,)), eo(), accept=[name])
    assert accepted["use"]["verdict"] == "use"
    s = summary(diagnostics(checks=(asks,)), eo())
    assert (s["use"]["verdict"], len(s["use"]["images"])) == ("except", 30)
    assert s["use"]["reasons"] == [f"{name}: by the other clock 2 m elsewhere; say it"]


def test_without_a_camera_the_trajectory_is_judged(diagnostics, summary) -> None:
    """Oracle: 3, 2, 4 mm north, east, down at all epochs."""
    for need, verdict in (((0.0021, 0.0031, 0.0041), "use"), ((0.0021, 0.0029, 0.0041), "no")):
        s = summary(diagnostics(), None, **with_need(need_m=need))
        assert (s["use"]["verdict"], s["use"]["images"]) == (verdict, [])
        assert ("the whole trajectory is known to" in run_verdict(s).why) == (verdict == "use")


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_every_reason_ends_without_full_stop(diagnostics, eo, summary, scale: float) -> None:
    """Oracle: the page puts it."""
    assert not run_verdict(summary(diagnostics(scale), eo()))[1].endswith(".")


def test_coarse_stamps_of_exposures_are_the_cause_of_what_they_cause(diagnostics, eo) -> None:
    """Oracle: by hand: 0.05 s at 10 m/s are 0.5 m; of a tilt that turns at 2 deg/s 0.1 deg. Stamps
    of a millisecond are no cause.
    """

    def judged(sigma_s: float) -> dict:
        velocity, rate = np.tile([10.0, 0, 0], (30, 1)), np.tile([np.radians(2.0), 0, 0], (30, 1))
        cov = eo().cov.copy()
        cov[:, 0, 0] += (10.0 * sigma_s) ** 2
        cov[:, 3, 3] += (np.radians(2.0) * sigma_s) ** 2
        images = replace(eo(), cov=cov, velocity_mps=velocity, rate_radps=rate)
        return run_summary(
            diagnostics(), images, {"name": "f"}, {}, {}, {}, (), exposure_sigma_s=sigma_s
        )

    coarse, fine = judged(0.05), judged(0.001)
    assert fine["use"]["verdict"] == "use"
    (reason,) = coarse["use"]["reasons"]
    assert (
        "the exposures' stamps are known to 0.05 s only, 500 mm along the path in the median"
        in reason
    )
    assert "tilt" not in [limit["topic"] for limit in coarse["limits"]]


@pytest.mark.parametrize(
    ("name", "left_out", "adopted"),
    [("GNSS sigmas", 0, True), ("incorrect fixes", 0, True), ("incorrect fixes", 9, False)],
)
def test_fixes_with_other_sigmas_do_not_fit_their_stated_ones(
    diagnostics, name, left_out, adopted
) -> None:
    """Oracle: by hand: what is left out enlarges no other sigma."""
    used = np.arange(1200) >= left_out
    check = Check(name, "larger", "as stated", "note", "look")
    headline = run_summary(diagnostics(used=used, checks=(check,)), None, {}, {}, {}, {}, ())[
        "headline"
    ]
    assert ("fit the accuracies adopted for them" in headline) is adopted
    assert ("their stated accuracies" in headline) is not adopted


def test_fixes_that_stand_apart_are_the_cause_in_their_span(diagnostics, eo, summary) -> None:
    """Oracle: by hand: the span holds the weak images or none of them; the remark that says the
    same is left out of the page.
    """
    orientation = eo()
    cov = orientation.cov.copy()
    cov[4:8, 0, 0] = 0.2**2
    images = replace(orientation, cov=cov)
    for begin, named in ((images.time[0], True), (images.time[12], False)):
        check = Check("incorrect fixes", "they stand apart", "one level", "note", "look at them")
        check = replace(check, spans_s=((float(begin), float(begin) + 20.0),))
        s = summary(diagnostics(checks=(check,)), images)
        (reason,) = s["use"]["reasons"]
        assert ("they stand apart; look at them; leave these images out, or" in reason) is named
        remarks = [*limits(s).parts, *limits(s).more]
        assert ("incorrect fixes" in str(remarks)) is not named
