"""Samples of left-handed axes, read with two axes exchanged so that they are right-handed."""

from dataclasses import replace

from ...geodesy.axes import parse_axes
from ...io.formats.imu.exchanged_columns import exchanged_columns
from ...navigation.recognise.handedness import exchange_axes, of_axes
from ...navigation.recognise.recognition import Recognition
from ...records import ImuSamples, Question
from .sources import InputSource

USUAL_AXES = "forward right down"


def right_handed(
    source: InputSource, imu: ImuSamples, recognition: Recognition
) -> tuple[InputSource, ImuSamples, Recognition]:
    """Exchange the two axes that make left-handed readings right-handed.

    Parameters
    ----------
    source : InputSource
        The samples as the flight file would name them.
    imu : ImuSamples
        As the file has them.
    recognition : Recognition
        With the exchanges that explain the motion; of them the one that shows the usual axes is
        taken, else the first.

    Returns
    -------
    tuple of InputSource, ImuSamples, Recognition
        With the exchange, and a note that says so; as they were, with a contradiction, where the
        format does not let the flight file name its columns.
    """
    usual = parse_axes(source.axes or USUAL_AXES)
    exchange = of_axes(recognition.exchanges, usual) or recognition.exchanges[0]
    keys, (a, b) = source.keys, exchange.words
    columns = exchanged_columns(
        source.path, exchange.pair, keys.get("columns"), keys.get("rate_hz"), keys.get("accel_file")
    )
    finding = (
        f"the axes are left-handed: {a} and {b} are exchanged in gyro and accelerometer, or one "
        f"of their signs is reversed in both; with {a} and {b} exchanged "
        f"{exchange.recognition.finding('gyro triad').evidence}"
    )
    if columns is None:
        advice = f"exchange {a} and {b} of gyro and accelerometer in the file"
        check = Question("IMU columns", "right-handed axes").contradiction(finding, advice)
        return source, replace(imu, notes=(*imu.notes, check)), recognition
    check = Question("IMU columns", "right-handed axes").note(
        finding,
        "check the axes printed on the sensor; the draft exchanges both columns in imu.columns",
    )
    imu = exchange_axes(imu, exchange.pair)
    return (
        replace(source, keys=keys | {"columns": columns}, why=source.why | {"columns": finding}),
        replace(imu, notes=(*imu.notes, check)),
        exchange.recognition,
    )
