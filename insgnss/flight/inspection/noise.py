"""The noise model of a drafted flight file: a shipped one, or one of what was measured."""

from ...base.units import MILLI_G
from .draft import NOISE_FILE, Draft
from .sensing import DEG_S, Sensing, fitting_model, noise_model


def draft_noise(draft: Draft, sensing: Sensing) -> None:
    """Name the shipped noise model that fits, or draft one of the recording.

    Parameters
    ----------
    draft : Draft
        Gets `imu.noise`, and the model where none fits.
    sensing : Sensing
    """
    quiet = (
        f"{sensing.rest_gyro.max() / DEG_S:.2g} deg/s/sqrt(Hz) and"
        f" {sensing.rest_accel.max() / MILLI_G:.2g} mg/sqrt(Hz)"
    )
    moving = (
        f"{sensing.moving_gyro.max() / DEG_S:.2g} and {sensing.moving_accel.max() / MILLI_G:.2g}"
    )
    state = "at rest" if sensing.rest_s > 0.0 else "where it is quietest"
    measured = f"white noise measured: {quiet} {state}"
    if not sensing.is_static:
        measured += f", {moving} in motion, where vibration counts"
    name = fitting_model(sensing)
    if name is not None:
        draft.add("imu", "noise", name, f"the shipped model fits: {measured}")
        return
    draft.add(
        "imu",
        "noise",
        NOISE_FILE,
        f"no shipped noise model fits ({measured}); the sensor is of the class {sensing.grade}",
    )
    draft.noise = noise_model(sensing, draft.tables[""][0].value)
    bias = (
        "the turn-on bias of the gyros is set from the mean rate at rest"
        if sensing.rest_s > 0.0
        else "no stationary period: turn-on biases are a-priori"
    )
    draft.noise_why = (
        f"Drafted by insgnss inspect. {measured[0].upper()}{measured[1:]}; the largest is taken.",
        (
            f"{bias[0].upper()}{bias[1:]}; Gauss-Markov processes, scale factors and "
            f"misalignments are a-priori values of a {sensing.grade} sensor. Static recordings "
            "give a better noise model: insgnss tune."
        ),
    )
