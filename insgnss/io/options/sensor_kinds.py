"""Kinds of options whose values other rooms judge: the axes of an IMU, units of GNSS columns."""

from typing import Any

from ...base.errors import InputError, near
from .kinds import OptionKind, no_mapping, no_text, register
from .schema import Declared


def _no_axes(item: Declared, value: Any) -> str:
    from ...geodesy.axes import parse_axes

    if problem := no_text(item, value):
        return problem
    try:
        parse_axes(value)
    except InputError as refusal:
        return refusal.problem
    return ""


def _no_unit(item: Declared, quantity: str, unit: object) -> str:
    from ..formats.gnss.fixes import QUALITY_CODES
    from ..formats.text.headers import KIND_OF
    from ..formats.text.units import SENSOR_SCALES, is_unit

    if quantity == "quality":
        if unit in QUALITY_CODES:
            return ""
        return f"is unknown; {near(str(unit), QUALITY_CODES)}"
    kind = KIND_OF.get(quantity, quantity)
    if isinstance(unit, str) and is_unit(unit, kind):
        return ""
    return f"is no unit for it: {near(str(unit), tuple(SENSOR_SCALES[kind]))}"


register("axes", OptionKind(_no_axes))
register("gnss_units", OptionKind(no_mapping, member=_no_unit))
