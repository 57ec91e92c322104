"""Kills, full disks and hostile directories in every verb that leaves products.

    python scripts/fault_lab.py DIR --kills 200 --full 200 --hostile 50 [--only process] [--seed 0]

Nothing may be lost, nothing torn in silence, and nothing outside the output changed.

Each verb first writes an older set of products, then a newer one over it, and is hit once on the
way. Kills: SIGKILL before a call of the operating system that changes names, drawn at random, or
after a random time. Full disks: a limit to the size of files (RLIMIT_FSIZE), and such calls
that fail with ENOSPC. The oracle are the bytes of the older and
of the newer set: after a kill every file is one or the other, whole; after a full disk all are the
older ones and the verb ended in one line. Then everything that reads the products does so: it ends
as with one of the two sets, or it is told of the kill. Hostile directories: products replaced by
links to files of the user, and what earlier versions believed in the directory (scratch directories
with a journal or a lead, marks), of this user or another. Nothing else in DIR may have changed.
"""

import argparse
import errno
import hashlib
import json
import multiprocessing
import os
import random
import re
import resource
import shutil
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from PIL import Image

from insgnss.cli.main import main as run_verb

CALLS = ("rename", "replace", "link", "unlink", "mkdir", "rmdir")
HASH, NUMBERS = re.compile(rb"[0-9a-f]{64}"), re.compile(rb"[\d.e+-]+")  # change with the date
TOLD = "killed while it moved its files"
TRIAL_S = 120.0  # time limit (s) of a trial: the longest verb takes five
RAW = "R/01_Observations/GPS/Data"
CAMERA = "--set camera=PINHOLE|7360|4912|7100|7100|3680|2456"
LEVELS = (0.0, 0.0, 0.0, 0.0, 0.0, -9.81)  # of a sensor at rest, rad/s and m/s^2
BLOCK = "A/01_Observations/Camera/Block"


@dataclass(frozen=True)
class Case:
    """A verb that replaces an older set of products by a newer one.

    Parameters
    ----------
    old, new : tuple of str
        The commands; OUT stands for where the products go.
    readers : tuple of tuple of str
        Commands that read the products, and after `|` the names of those that they read.
    """

    old: tuple[str, ...]
    new: tuple[str, ...]
    readers: tuple[tuple[str, ...], ...] = ()


def _words(command: str) -> tuple[str, ...]:
    """Return a command word by word; | stands for a blank within one, but alone."""
    return tuple(word if word == "|" else word.replace("|", " ") for word in command.split())


def _two(command: str, *readers: str) -> Case:
    """Return the case of a command in which {s} is the data set A, then B."""
    old, new = (_words(command.format(s=s, t=t)) for s, t in (("A", "1"), ("B", "2")))
    return Case(old, new, tuple(map(_words, readers)))


CASES = {
    "process": _two(
        "process {s}/flight.toml --out OUT --force",
        "export OUT metashape --out READ/x.csv | eo.json",
        "compare OUT/eo.json A/truth/EO_local-plane.txt --out READ/c.html | eo.json",
        "compare OUT/trajectory.sbet OUT/trajectory.csv --out READ/t.html"
        " | trajectory.sbet trajectory.csv",
        f"targets predict OUT/eo.json {BLOCK}/ground_points.csv {BLOCK}/camera.toml"
        " --out READ/p.csv | eo.json",
        "archive OUT | eo.json report.json trajectory.csv",
    ),
    "export_colmap": _two(f"export done{{s}}/eo.json colmap --out OUT --force {CAMERA}"),
    "export_opf": _two(
        "export done{s}/eo.json opf --out OUT --force --crs EPSG:32632"
        f" {CAMERA} --set pixel_size_um=4.9"
    ),
    "export_image_tags": _two(
        "export done{s}/eo.json image_tags --out OUT --force --set images=photos --set missing=skip"
    ),
    "ppk": _two(
        f"ppk {RAW}/Rover/rov01840.18o --base {RAW}/Master/tr2b0703a.18o --navigation"
        f" {RAW}/Rover/rov01840.18n --base-position 46.580793535,6.5282590728,51{{t}}.0"
        " --base-point apc --out OUT --force",
        "compare OUT/ppk.pos OUT/ppk.pos --out READ/c.html | ppk.pos",
        "archive OUT | ppk.pos ppk.json",
    ),
    "adjust": _two(
        "adjust {s}/block.toml --out OUT --force",
        "export OUT/eo.json metashape --out READ/x.csv | eo.json",
        "compare OUT/eo.json A/truth/EO_local-plane.txt --out READ/c.html | eo.json",
        "archive OUT | eo.json adjust.json",
    ),
    "tune": _two(
        "tune static{s}.csv --model WN --gyro-unit rad/s --accel-unit m/s^2 --out OUT.toml --force",
        "export OUT.toml kalibr --set rate=200 --out READ/imu.yaml | out.toml",
    ),
    "targets": _two(
        f"targets predict done{{s}}/eo.json {BLOCK}/ground_points.csv {BLOCK}/camera.toml"
        " --out OUT.csv --force",
    ),
    "simulate": Case(
        (),
        _words("simulate OUT --flight ign6x1 --minutes 3 --imu-rate 50 --seed 3"),
        (_words("process OUT --out READ/p | flight.toml"),),
    ),
    "batch": _two(
        "batch {s} --out OUT --force",
        "batch A --out OUT | season.csv",
    ),
}


def main() -> int:
    """Run the trials; return 1 where one of them shows a defect."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n\n")[0])
    parser.add_argument("directory", type=Path, help="of the data and the trials; made if missing")
    parser.add_argument("--kills", type=int, default=200, help="of all verbs together")
    parser.add_argument("--full", type=int, default=200, help="of all verbs together")
    parser.add_argument("--hostile", type=int, default=50, help="of all verbs together")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", choices=tuple(CASES), default=tuple(CASES))
    given = parser.parse_args()
    lab, defects = Lab(given.directory.absolute(), random.Random(given.seed)), 0
    for i, name in enumerate(given.only):
        case, verbs = lab.prepared(name), len(given.only)
        trials = (lab.kill, given.kills), (lab.full, given.full), (lab.hostile, given.hostile)
        for trial, count in trials:
            times = count // verbs + (i < count % verbs)
            outcomes = Counter(trial(case) for _ in range(times))
            defects += sum(n for text, n in outcomes.items() if "DEFECT" in text)
            print(f"{name}, {trial.__name__}:", flush=True)
            for text, n in outcomes.most_common():
                print(f"  {n:3d} {text}", flush=True)
    print(f"{defects} defects")
    return 1 if defects else 0


@dataclass
class Prepared:
    """A case with the bytes of both sets, and what the newer one takes.

    Parameters
    ----------
    case : Case
        The case.
    old, new : dict
        Bytes of the files of both sets by their paths from the directory of the trial.
    calls : int
        Calls of the operating system of the newer command that change names.
    seconds : float
        What it takes.
    """

    case: Case
    old: dict[str, bytes]
    new: dict[str, bytes]
    calls: int
    seconds: float


class Lab:
    """A directory with data, in which verbs run in children that are hit.

    Parameters
    ----------
    root : Path
        The directory.
    rng : Random
        Draws what is hit, and when.
    """

    def __init__(self, root: Path, rng: random.Random) -> None:
        self.root, self.rng = root, rng
        self.trial, self.read = root / "trial", root / "read"
        root.mkdir(parents=True, exist_ok=True)
        os.chdir(root)
        self._make_data()
        self.inputs = self._hashes()

    def _make_data(self) -> None:
        simulate = "--flight ign6x1 --minutes 3 --imu-rate 50"
        for place, command in (
            ("A", f"simulate A {simulate} --seed 1 --block"),
            ("B", f"simulate B {simulate} --seed 2 --block"),
            ("R", f"simulate R {simulate} --seed 1 --raw-gnss"),
            *((f"{s}/02_Processed/GPS-INS", f"process {s}/flight.toml") for s in "AB"),
            *((f"done{s}", f"process {s}/flight.toml --out done{s}") for s in "AB"),
        ):
            if not (self.root / place).is_dir():
                code, line = self._run(tuple(command.split()))
                if code:
                    raise SystemExit(f"{command}: {line}")
        for s in "AB":
            noise = random.Random(s)
            rows = (
                ",".join([f"{i / 50:.2f}", *(f"{noise.gauss(g, 1e-3):.9f}" for g in LEVELS)])
                for i in range(6000)
            )
            text = "\n".join(["# gyro rad/s, accel m/s^2", "time,gx,gy,gz,ax,ay,az", *rows])
            (self.root / f"static{s}.csv").write_text(text + "\n")
        (self.root / "photos").mkdir(exist_ok=True)
        (self.root / "victims").mkdir(exist_ok=True)
        (self.root / "victims/precious").write_text("of the user")
        for number in range(6001, 6006):
            Image.new("L", (8, 8)).save(self.root / "photos" / f"{number}.tif")

    def prepared(self, name: str) -> Prepared:
        """Run both commands of a case once, for their bytes."""
        case = CASES[name]
        self._clear()
        if case.old:
            self._must(case.old)
        old, counter = self._content(), _Calls(0, None)
        start = time.monotonic()
        self._must(case.new, counter.install)
        seconds = time.monotonic() - start
        return Prepared(case, old, self._content(), counter.count.value, seconds)

    def kill(self, one: Prepared) -> str:
        """Kill the newer command once; return what became of the products."""
        self._place_old(one)
        if self.rng.random() < 0.8:
            hit = _Calls(self.rng.randrange(1, one.calls + 1), _kill)
            self._run(one.case.new, hit.install)
        else:
            self._run(one.case.new, limit_s=self.rng.random() * one.seconds)
        content = self._content()
        for name, data in content.items():
            if not (_is(data, one.old.get(name)) or _is(data, one.new.get(name))):
                return f"DEFECT: {name} is neither old nor new"
        if lost := [name for name in one.old if name in one.new and name not in content]:
            return f"DEFECT: lost {lost}"
        if changed := self._changed():
            return f"DEFECT: changed outside: {changed}"
        readings = Counter(self._reading(one, reader, content) for reader in one.case.readers)
        state = "old" if _same(content, one.old) else "new" if _same(content, one.new) else "torn"
        return f"{state}: readers {', '.join(sorted(readings))}"

    def _reading(self, one: Prepared, reader: tuple[str, ...], content: dict[str, bytes]) -> str:
        """Read products by a verb; return whether it read one set, was told, or refused."""
        at = reader.index("|")
        code, line = self._run(reader[:at])
        if code:
            return "told" if TOLD in line else "refuse"
        names = [name if name.startswith("out") else f"out/{name}" for name in reader[at + 1 :]]
        for files in (one.old, one.new):
            if all(name in content and _is(content[name], files.get(name)) for name in names):
                return "read"
        return f"DEFECT: {' '.join(reader[:at])} reads a mixture"

    def full(self, one: Prepared) -> str:
        """Let the newer command find a full disk; return what became of the products."""
        self._place_old(one)
        if self.rng.random() < 0.5:
            prepare = _Calls(self.rng.randrange(1, one.calls + 1), _no_space).install
        else:
            limit = self.rng.randrange(max(map(len, one.new.values())))
            prepare = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (limit, limit))
        code, line = self._run(one.case.new, prepare)
        content = self._content()
        if changed := self._changed():
            return f"DEFECT: changed outside: {changed}"
        if code == 0 and _same(content, one.new):
            return "new, exit 0"
        if code in (0, 1) or code < 0 or line.count("\n") > 1:
            names = [n for n in one.new if not _is(content.get(n, b""), one.new[n])]
            return f"DEFECT: exit {code}: {line[-300:]!r}, not as written before: {names}"
        if not _same(content, one.old):
            names = [n for n in {*content, *one.old} if content.get(n) != one.old.get(n)]
            return f"DEFECT: {names} not as before, {line!r}"
        return f"old, exit {code}"

    def hostile(self, one: Prepared) -> str:
        """Run the newer command over a directory in which somebody planted traps."""
        self._place_old(one)
        victims = self.root / "victims"
        folders = [self.trial, *(path for path in self.trial.rglob("*") if path.is_dir())]
        for name in one.old:
            if self.rng.random() < 0.3:
                (self.trial / name).unlink()
                (self.trial / name).symlink_to(victims / "precious")
        if len(folders) > 2 and self.rng.random() < 0.3:
            shutil.rmtree(folder := folders.pop())
            folder.symlink_to(victims)
        for folder in (folder for folder in folders if folder.is_dir()):
            for name in (".insgnss-abcdefgh", ".insgnss-run-abcdefgh", ".insgnss-run-backup"):
                self._plant(folder / name, victims)
            if self.rng.random() < 0.5:
                (folder / ".insgnss-unfinished").symlink_to(victims / "precious")
        code, line = self._run(one.case.new)
        if changed := self._changed():
            return f"DEFECT: changed outside: {changed}"
        if code in (0, 2, 3) and line.count("\n") <= 1:
            return f"exit {code}"
        return f"DEFECT: exit {code}: {line[-300:]!r}"

    def _plant(self, folder: Path, victims: Path) -> None:
        folder.mkdir(mode=0o700)
        to_victims = os.path.relpath(victims, folder)
        moves = [[f"{to_victims}/other", f"{to_victims}/precious", None]]
        (folder / "journal.json").write_text(json.dumps({"made": [], "moves": moves}))
        (folder / "lead").write_text(json.dumps(to_victims))
        (folder / "owner").write_text("nowhere 1")
        (folder / "inner").symlink_to(victims)
        if os.geteuid() == 0 and self.rng.random() < 0.5:
            os.chown(folder, 65534, 65534)

    def _place_old(self, one: Prepared) -> None:
        self._clear()
        for name, data in one.old.items():
            (self.trial / name).parent.mkdir(parents=True, exist_ok=True)
            (self.trial / name).write_bytes(data)

    def _clear(self) -> None:
        for directory in (self.trial, self.read):
            shutil.rmtree(directory, ignore_errors=True)
            directory.mkdir()

    def _content(self) -> dict[str, bytes]:
        """Return the bytes of the products; what a killed run leaves beside them is none."""
        return {
            path.relative_to(self.trial).as_posix(): path.read_bytes()
            for path in self.trial.rglob("*")
            if path.is_file() and "/.insgnss-" not in path.as_posix()
        }

    def _hashes(self) -> dict[str, str]:
        """Return the hashes of all files that no trial may change."""
        return {
            path.relative_to(self.root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in self.root.rglob("*")
            if path.is_file() and not {self.trial, self.read} & set(path.parents)
        }

    def _changed(self) -> list[str]:
        now = self._hashes()
        return [name for name in {*now, *self.inputs} if now.get(name) != self.inputs.get(name)]

    def _must(self, command: tuple[str, ...], prepare: Callable[[], object] = tuple) -> None:
        code, line = self._run(command, prepare)
        if code:
            raise SystemExit(f"{' '.join(command)}: {line}")

    def _run(
        self,
        command: tuple[str, ...],
        prepare: Callable[[], object] = tuple,
        limit_s: float = TRIAL_S,
    ) -> tuple[int, str]:
        """Run a command in a child; return its exit code and its standard error."""
        places = {"OUT": f"{self.trial}/out", "READ": str(self.read)}
        words = [re.sub("OUT|READ", lambda match: places[match[0]], word) for word in command]
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.setsid()
            os.dup2(writing, 2)
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            sys.stdout, sys.stderr = open(1, "w"), open(2, "w")  # noqa: SIM115
            code = 99
            try:
                prepare()
                code = run_verb([*words, "--quiet"])
                sys.stderr.flush()
            finally:
                os._exit(code)
        os.close(writing)
        deadline = time.monotonic() + limit_s
        while not (ended := os.waitpid(child, os.WNOHANG))[0]:
            if time.monotonic() > deadline:
                os.killpg(child, signal.SIGKILL)
                ended = os.waitpid(child, 0)
                break
            time.sleep(0.005)
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)  # workers that a killed parent leaves
        with open(reading, errors="replace") as stream:
            return os.waitstatus_to_exitcode(ended[1]), stream.read()


class _Calls:
    """Counts calls of the operating system that change names, and does something at one of them.

    Parameters
    ----------
    at : int
        Which, from 1.
    action : callable or None
        Called before it.
    """

    def __init__(self, at: int, action: Callable[[], None] | None) -> None:
        self.at, self.action, self.count = at, action, multiprocessing.Value("i", 0)

    def install(self) -> None:
        """Put itself before the calls, in this process."""
        for name in CALLS:
            setattr(os, name, self._counted(getattr(os, name)))

    def _counted(self, function: Callable[..., object]) -> Callable[..., object]:
        def call(*values: object, **options: object) -> object:
            with self.count.get_lock():
                self.count.value += 1
                is_hit = self.count.value == self.at
            if is_hit and self.action is not None:
                self.action()
            return function(*values, **options)

        return call


def _kill() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def _no_space() -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _is(data: bytes, reference: bytes | None) -> bool:
    """Tell whether a file is another one but for dates, times and hashes."""
    if reference is None or data == reference:
        return data == reference
    return abs(len(data) - len(reference)) < 200 and _plain(data) == _plain(reference)


def _plain(data: bytes) -> bytes:
    return NUMBERS.sub(b"", HASH.sub(b"", data))


def _same(content: dict[str, bytes], files: dict[str, bytes]) -> bool:
    return set(content) == set(files) and all(_is(content[n], files[n]) for n in files)


if __name__ == "__main__":
    sys.exit(main())
