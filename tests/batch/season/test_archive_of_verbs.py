"""Every verb that leaves products says what they were made from, and `archive` holds them to it."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from insgnss.base.provenance import DIGESTS_KEY, INPUTS_KEY
from insgnss.batch.season.archive import examine_archive
from insgnss.cli import main
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.image_block import BlockOptions
from insgnss.simulation.raw_gnss.options import RawGnssOptions

pytestmark = pytest.mark.slow
RINEX, BLOCK = "01_Observations/GPS/Data", "01_Observations/Camera/Block"
EO = "02_Processed/GPS-INS/eo.json"
VERBS = {
    "02_Processed/GPS-INS/report.json": "process flight.toml",
    "02_Processed/Adjustment/adjust.json": "adjust block.toml",
    "made/ppk/ppk.json": (
        f"ppk {RINEX}/Rover/rov01840.18o --base {RINEX}/Master/tr2b0703a.18o --navigation"
        f" {RINEX}/Rover/rov01840.18n {RINEX}/Rover/rov01840.18g --out made/ppk"
        " --events 01_Observations/Camera/Data/Events.txt"
    ),
    "made/predictions.json": (
        f"targets predict {EO} {BLOCK}/ground_points.csv {BLOCK}/camera.toml"
        " --out made/predictions.csv"
    ),
    "made/mounting.json": (
        "calibrate mounting flight.toml 02_Processed/Adjustment/poses.csv --out made/mounting.toml"
    ),
    "made/noise.json": "tune --flight flight.toml --out made/noise.toml",
    "made/static.json": (
        "tune still.csv --model WN --gyro-unit rad/s --accel-unit m/s^2 --out made/static.toml"
    ),
}
"""Documents of the verbs' results, and the commands."""
UNNAMED = {"adjust.json": {"report.json"}}
"""Of the report of a flight an adjustment takes the mounting that its orientation has anyway."""
KEPT = {"made/noise.json"}
"""Here the flight keeps its noise model, and nothing is written beside document and page."""
WATCHED = """
import os, sys
seen, root = set(), os.getcwd()
def watch(event, given):
    if event == 'open' and isinstance(given[0], (str, bytes)):
        name, mode, flags = given
        if not flags & (os.O_WRONLY | os.O_RDWR):
            seen.add(os.path.realpath(os.fsdecode(name)))
sys.addaudithook(watch)
from insgnss.cli import main
code = main([*sys.argv[2:], '-q'])
with open(sys.argv[1], 'w') as stream:
    stream.writelines(f'{name}\\n' for name in sorted(seen) if name.startswith(root + os.sep))
sys.exit(code)
"""


@dataclass(frozen=True)
class Made:
    """A flight with the results of all verbs.

    Parameters
    ----------
    root : Path
        Its directory.
    read : dict
        By document the files below it that the verb opened to read.
    """

    root: Path
    read: dict[str, set[str]]

    def document(self, name: str) -> dict:
        return json.loads((self.root / name).read_text(encoding="utf-8"))

    def inputs(self, name: str) -> set[Path]:
        """Inputs that a document names, absolute."""
        content = self.document(name)
        base = content.get("inputs_directory", content.get("flight_directory", "."))
        folder = (self.root / name).parent / base
        return {Path(os.path.realpath(folder / one)) for one in content[INPUTS_KEY]}

    def problems(self, name: str) -> tuple[str, ...]:
        """What `archive` says of one result."""
        runs = examine_archive(self.root, False, lambda _: None).runs
        return next(run.problems for run in runs if run.document == self.root / name)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """Two minutes of flight, every verb by its command."""
    pytest.importorskip("pyrtklib5")
    scratch = tmp_path_factory.mktemp("verbs")
    root = scratch / "flight"
    block = BlockOptions(tie_points=30.0, control=10, check=5)
    raw = RawGnssOptions()
    write_dataset(
        *(root, "ign8", 2.5),
        imu_rate=50.0,
        seed=3,
        start_in_air=True,
        block=block,
        raw_gnss=raw,
    )
    (root / "made").mkdir()
    noise = np.random.default_rng(1).normal(size=(30_000, 6)) * ([1e-3] * 3 + [1e-2] * 3)
    samples = np.column_stack([np.arange(30_000) / 50.0, noise - (0, 0, 0, 0, 0, 9.8)])
    head = "tow,gx,gy,gz,ax,ay,az"
    np.savetxt(root / "still.csv", samples, "%.7f", ",", header=head, comments="")
    read = {}
    for name, command in VERBS.items():
        words = [sys.executable, "-c", WATCHED, str(scratch / "read"), *command.split()]
        done = subprocess.run(words, cwd=root, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        read[name] = set((scratch / "read").read_text().split("\n")) - {""}
    return Made(Path(os.path.realpath(root)), read)


@pytest.mark.parametrize("name", VERBS)
def test_every_file_that_a_verb_reads_is_an_input_that_it_names(made: Made, name: str) -> None:
    """Oracle: Python's own audit of the files that are opened, less what the run itself wrote."""
    content = made.document(name)
    folder = (made.root / name).parent
    own = {os.path.realpath(folder / one) for one in content[DIGESTS_KEY]}
    own |= {str(made.root / name), str((made.root / name).with_suffix(".html"))}
    read = {Path(one) for one in made.read[name] - own if ".insgnss" not in one}
    unnamed = {path for path in read if path.is_file()} - made.inputs(name)
    assert {path.name for path in unnamed} <= UNNAMED.get(Path(name).name, set())
    assert made.inputs(name) >= {path for path in read if path.is_file()} - unnamed != set()
    assert content["versions"]["insgnss"]
    assert content["run"]["command"].split()[0] != ""


@pytest.mark.parametrize("name", VERBS)
def test_each_result_is_held_to_its_inputs_and_products(made: Made, name: str) -> None:
    """Oracle: what is done to the files, one by one: changed, removed, put back."""
    assert made.problems(name) == ()
    content = made.document(name)
    products = [(made.root / name).parent / one for one in content[DIGESTS_KEY]]
    assert bool(products) == (name not in KEPT)
    for kind, paths in (("input", sorted(made.inputs(name))), ("product", products)):
        for path in paths:
            held = path.read_bytes()
            path.write_bytes(held + b"\n")
            (said,) = [one for one in made.problems(name) if path.name in one]
            assert said.startswith(f"{kind} ")
            assert "changed" in said
            path.unlink()
            (said,) = [one for one in made.problems(name) if path.name in one]
            assert "is missing" in said
            path.write_bytes(held)
    assert made.problems(name) == ()


def test_all_of_them_hold_where_the_archive_was_moved(
    made: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: a copy elsewhere, and a version that is another one; products that no document knows
    are named.
    """
    copy = tmp_path / "deep" / "archive"
    shutil.copytree(made.root, copy)
    assert main(["archive", str(copy), "-q"]) == 0
    assert f"{len(VERBS)} of {len(VERBS)} results can be made again" in capsys.readouterr().out
    document = copy / "made" / "noise.json"
    document.write_text(document.read_text().replace('"insgnss": "', '"insgnss": "0.', 1))
    assert main(["archive", str(copy), "-q"]) == 4
    assert "made/noise.json: made by insgnss 0." in capsys.readouterr().out
    (copy / "02_Processed" / "GPS-INS" / "report.json").unlink()
    assert main(["archive", str(copy), "-q"]) == 4
    assert "eo.json: no JSON document states the inputs of this product" in capsys.readouterr().out
