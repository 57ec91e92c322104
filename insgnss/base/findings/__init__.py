"""What is found of a recording, an installation or a result, with a verdict and what to do.

A `Question` has a name and what a right answer looks like; its answers are `Finding`s:

    course = Question("heading against course", "median within 60 deg")
    course.ok("never faster than 8 m/s")
    course.contradiction("median 91.0 deg", SetKey("imu.axes", "right backward down"))

finding     `Finding`, `Question`, and their lines on the terminal
remedies    what to do: a setting (`SetKey`) or an action (`Step`), written as each caller does
"""

from .finding import Finding, Question, Verdict, check_lines, ranked

__all__ = ["Finding", "Question", "Verdict", "check_lines", "ranked"]
