"""A script that stands for rnx2rtkp, and small inputs for it: it notes what it is given and leaves
the .pos that it is told to.
"""

import json
import stat
import sys

from written_rinex import epoch2, header2, record

from insgnss.gnss.engine.rtklib import solve
from insgnss.gnss.options import EngineOptions

BASE = (3774096.81, -601661.65, 5089318.44)
BASE_LLH = (53.2804, -9.0578, 70.0)
HEAD = (
    "% program   : RTKLIB ver.{version}\n%\n%"
    " (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=#)\n%  GPST"
    "  latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m)"
    " age(s) ratio\n"
)
SCRIPT = """#!{python}
import json, os, sys, time
words = sys.argv[1:]
name = words[words.index("-k") + 1].split(".")[0]
files = words[words.index("-o") + 2:]
texts = [open(f).read() for f in files]
conf = open(name + ".conf").read()
told = dict(words=words, name=name, conf=conf, files=texts, pid=os.getpid())
open({log!r}, "a").write(json.dumps(told) + "\\n")
do = json.load(open({plan!r})).get(name, {{}})
time.sleep(do.get("sleep", 0))
sys.stderr.write(do.get("say", ""))
if "pos" in do:
    open(words[words.index("-o") + 1], "w").write(do["pos"])
sys.exit(do.get("code", 0))
"""


def pos(rows, version="EX 2.5.0"):
    """A .pos of rows of time of week, latitude, longitude, height."""
    row = "2021 {:.9f} {:.9f} {:.9f} {:.4f} 1 8 0.01 0.01 0.02 0.001 0.001 0.001 0.0 10.0\n"
    return HEAD.format(version=version) + "".join(row.format(*values) for values in rows)


def standing(lat=BASE_LLH[0], step=0.0):
    """A .pos of a receiver that moves by `step` degrees of latitude a second."""
    return pos([(392700.0 + k, lat + k * step, BASE_LLH[1], BASE_LLH[2]) for k in range(5)])


def observations(
    day=4, types=("C1", "L1", "P2", "L2"), approx=None, epochs=5, system="G", step=1.0
):
    place = "".join(f"{x:14.4f}" for x in approx) if approx else ""
    more = record(place, "APPROX POSITION XYZ") if approx else ""
    rows = {f"{system}{k:02d}": [2.1e7 + k] * len(types) for k in range(1, 7)}
    return header2(types, more=more) + "".join(
        epoch2((2018, 10, day, 13, 5, k * step), rows) for k in range(epochs)
    )


def navigation(day=4, system="N", satellite=2):
    numbers = [f"{x:19.12E}".replace("E", "D") for x in (0.0, 0.0, 0.0)]
    elements = [
        36.0,
        0,
        0,
        0,
        0,
        0.01,
        0,
        5153.6,
        46800.0 + 86400.0 * day,
        0,
        1.0,
        0,
        0.95,
        250.0,
        -1.8,
        -8e-9,
        0,
        0,
        2021.0,
        0,
        2.0,
        0,
        0,
        36.0,
        0,
    ]
    lines = [elements[k : k + 4] for k in range(0, 25, 4)]
    body = "".join(
        "   " + "".join(f"{x:19.12E}".replace("E", "D") for x in line) + "\n" for line in lines
    )
    first = f"{satellite:2d} 18 10 {day:2d} 13  0  0.0" + "".join(numbers) + "\n"
    head = record(f"{2.11:9.2f}{'':11}{'NAVIGATION DATA':<20}", "RINEX VERSION / TYPE") + record(
        "", "END OF HEADER"
    )
    return head + first + body


class Fake:
    """Files of a solution that can be had, and the script with its plan."""

    def __init__(self, directory):
        self.directory, self.log, self.plan = directory, directory / "log", directory / "plan"
        self.out = directory / "out"
        self.rover, self.base, self.nav = (
            directory / name for name in ("rover %Y.18o", "base.18o", "brdc.18n")
        )
        self.rover.write_text(observations(approx=(BASE[0] - 400.0, BASE[1], BASE[2])))
        self.base.write_text(observations(approx=BASE))
        self.nav.write_text(navigation())
        self.program = directory / "rnx2rtkp"
        self.program.write_text(
            SCRIPT.format(python=sys.executable, log=str(self.log), plan=str(self.plan))
        )
        self.program.chmod(self.program.stat().st_mode | stat.S_IXUSR)
        self.does()

    def does(self, **more):
        """The plan: what each run does, on top of a solution that goes well."""
        well = {
            name: {"pos": pos([(392700.0, 53.29, -9.05, 75.0 + k)])}
            for k, name in enumerate(("forward", "backward"))
        }
        self.plan.write_text(json.dumps({**well, "where_base": {"pos": standing()}, **more}))

    def solve(self, navigation=None, **options):
        given = {
            "base_position_m": BASE,
            "base_point": "apc",
            "engine": str(self.program),
        } | options
        return solve(
            self.rover,
            self.base,
            self.nav if navigation is None else navigation,
            EngineOptions(**given),
            self.out,
        )

    def told(self):
        return {line["name"]: line for line in map(json.loads, self.log.read_text().splitlines())}


def one_line(info):
    text = str(info.value)
    assert "\n" not in text
    return text
