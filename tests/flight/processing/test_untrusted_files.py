"""Messages about files that a flight file of somebody else names outside of its directory."""

import re
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest

import insgnss
from insgnss.base.errors import DataError, InputError, InsgnssError
from insgnss.base.received.trusted import SHOWN_VARIABLE, at_home, trusting
from insgnss.base.tables import read_toml
from insgnss.batch.season.work import Task, process_task
from insgnss.cli import main
from insgnss.flight.config.block_file import BLOCK_TABLES, load_block
from insgnss.flight.config.flight_file import FLIGHT_TABLES
from insgnss.flight.config.load import load_flight
from insgnss.flight.processing.recording import read_recording
from insgnss.io.formats.imu.imu_csv import read_imu_csv
from insgnss.io.options.schema import options_of
from insgnss.photogrammetry.block_adjustment.run import adjust
from insgnss.simulation.dataset import write_dataset

SECRET = "hunter2"
RAW = 'rover = "x.obs"\nbase = "x.obs"\nnavigation = ["x.nav"]\n'
READ = {"include", "file", "accel_file", "noise", "calibration", "events", "rover"}
"""Options whose files are read when the flight is."""
FILES = {
    "passwd": f"{SECRET}a:x:0:0:{SECRET}b:/{SECRET}c:/bin/{SECRET}d\n" * 3,
    "words.txt": f"1 2 3 4 5 6 7\n1 2 3 {SECRET}a 5 6 7\n",
    "head.csv": f"{SECRET}a,{SECRET}b,{SECRET}c\n1,2,3\n4,5,6\n",
    "keys.toml": f'[{SECRET}a]\n{SECRET}b = "{SECRET}c"\n',
    "key.toml": f"{SECRET}a = {SECRET}b\n",
    "of_ours.toml": f'name = "{SECRET}a"\nformat = "{SECRET}b"\n',
    "x.json": f'{{"{SECRET}a": "{SECRET}b", "format": "{SECRET}c"}}\n',
    "x.xml": f"<{SECRET}a b='{SECRET}c'>{SECRET}d</{SECRET}a>\n",
    "x.obs": f"{'     3.04           OBSERVATION DATA    M':60}RINEX VERSION / TYPE\n"
    f"{SECRET + 'a':60}END OF HEADER\n> 2020 {SECRET}b\n",
    "x.pos": f"% GPST latitude(deg) longitude(deg) height(m)\n2020/01/01 {SECRET}a 1 2 3\n",
}


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("untrusted") / "good"
    write_dataset(root, "ign8", 1.0, imu_rate=50.0, seed=11, start_in_air=True)
    shutil.rmtree(root / "truth")
    return root


@pytest.fixture
def sent(good: Path, tmp_path: Path) -> Path:
    """A flight that was sent; what is secret lies beside it."""
    shutil.copytree(good, tmp_path / "sent")
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path / "sent"


def said(job: Callable[[], object]) -> str:
    """Return all that a job says."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            job()
            line = ""
        except InsgnssError as error:
            line = str(error)
    return "\n".join([line, *(str(one.message) for one in caught)])


def with_option(text: str, table: str, key: str, value: str) -> str:
    """Return a flight file or block file with an option, in place of its own."""
    head, *tables = ("\n" + text).split("\n[")
    parts = {part.partition("]")[0]: part.partition("]")[2].strip().split("\n") for part in tables}
    lines = head.strip().split("\n") if not table else parts.setdefault(table, [])
    lines[:] = [line for line in lines if line.partition("=")[0].strip() != key]
    lines.append(f"{key} = {value}")
    head = "\n".join(lines) if not table else head
    return head + "".join(f"\n[{name}]\n" + "\n".join(own) for name, own in parts.items()) + "\n"


def options(tables: Mapping[str, tuple[type, ...]]) -> Iterator[tuple[str, str]]:
    """Return every option that takes a path, and those that take a name of ours or a path."""
    for table, classes in tables.items():
        for item in options_of(table, classes):
            if "Path" in str(item.type) or item.name in ("noise", "rename", "crs"):
                yield table, item.name


def spoken(file: Path, text: str, table: str, key: str, job: Callable[[], object]) -> int:
    """Refuse every secret file as this option; return how many of the refusals hide it."""
    count = 0
    for name in FILES:
        for value in (f'"../{name}"', f'["../{name}"]'):
            file.write_text(with_option(text, table, key, value))
            line = said(job)
            assert SECRET not in line, (table, key, name)
            count += "which is not shown" in line
    return count


@pytest.mark.slow
def test_no_option_of_a_flight_file_makes_a_file_elsewhere_speak(sent: Path) -> None:
    """Oracle: the secret, in every file, named by every option there is, alone and in a list."""
    file = sent / "flight.toml"
    text = file.read_text()
    for name in ("x.obs", "x.nav"):
        (sent / name).write_text("no RINEX\n")
    raw = re.sub(r"(?<=\[gnss\]\n)(.*\n)*?(?=\[)", RAW, text)
    hidden = {}
    for table, key in options(FLIGHT_TABLES):
        if table.count(".") == 0 and ".further" not in table:
            own = raw if key in ("rover", "base", "navigation", "antex") else text
            hidden[key] = spoken(file, own, table, key, lambda: read_recording(load_flight(file)))
    assert {key for key, count in hidden.items() if count >= len(FILES) - 1} >= READ


@pytest.mark.slow
def test_no_option_of_a_block_file_makes_a_file_elsewhere_speak(sent: Path) -> None:
    """Oracle: as above; the image observations are the first that is read."""
    file = sent / "block.toml"
    (sent / "points.csv").write_text("image,point,x,y\na.tif,1,10.0,20.0\na.tif,2,30.0,40.0\n")
    (sent / "ground.csv").write_text("point,x,y,z\n1,10.0,20.0,1.0\n2,30.0,40.0,2.0\n")
    text = '[images]\nfile = "points.csv"\n[ground]\nfile = "ground.csv"\n'
    hidden = {
        f"{table}.{key}": spoken(
            file, text, table, key, lambda: adjust(load_block(file), write=False)
        )
        for table, key in options(BLOCK_TABLES)
    }
    expected = {"images.file", "ground.file", "camera.file", "aerial_control.file"}
    assert {key for key, count in hidden.items() if count} >= expected, hidden


@pytest.mark.slow
@pytest.mark.parametrize("key", ["geoid", "crs", "rename"])
def test_files_that_products_are_made_with_are_silent_as_well(sent: Path, key: str) -> None:
    """Oracle: the secret; these files are read when the flight has been solved."""
    file = sent / "flight.toml"
    text = file.read_text()
    for name in ("words.txt", "head.csv", "passwd"):
        value = f'["../{name}"]' if key == "rename" else f'"../{name}"'
        file.write_text(with_option(text, "output", key, value))
        assert SECRET not in said(lambda: insgnss.process(file))


def test_a_command_shows_what_its_own_words_name(
    sent: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the first line of the file that the command names, and no word of one it does not."""
    secret, file = sent.parent / "keys.toml", sent / "flight.toml"
    assert main(["process", str(file), "--mounting", str(secret)]) == 3
    assert f"{SECRET}a" in capsys.readouterr().err
    file.write_text('include = "../keys.toml"\n' + file.read_text())
    monkeypatch.chdir(sent)  # where `batch` leaves its page
    for words in ([str(file)], [str(sent)], [str(sent / "fl*.toml")]):
        assert main(["batch" if "*" in words[0] else "process", *words, "--quiet"]) == 3
        seen = "".join(capsys.readouterr())
        assert SECRET not in seen
        assert "keys.toml:1: has an error, which is not shown" in seen
    assert main(["process", str(file), "--out", str(sent.parent)]) == 3
    assert "unknown table or key" in capsys.readouterr().err
    monkeypatch.setenv(SHOWN_VARIABLE, str(sent.parent))
    assert main(["process", str(file)]) == 3
    assert f"{SECRET}a: unknown table or key" in capsys.readouterr().err


def test_a_link_in_the_tree_that_was_sent_leads_out_of_it(sent: Path) -> None:
    """Oracle: the secret, behind names that look like the end of a path in a message."""
    file = sent / "flight.toml"
    text = file.read_text()
    for name in ("link", "a: b", "a:1: b", "a\nb"):
        (sent / name).symlink_to(sent.parent / "words.txt")
        file.write_text(with_option(text, "imu", "file", repr(name).replace("'", '"')))
        line = said(lambda: read_recording(load_flight(file)))
        assert "which is not shown" in line
        assert SECRET not in line


def test_keys_of_ours_in_a_shared_file_are_shown(sent: Path) -> None:
    """Oracle: the value; a table with such keys is no text of others."""
    file = sent / "flight.toml"
    text = file.read_text().replace('axes = "forward right down"\n', "")
    file.write_text('include = "../wing.toml"\n' + text)
    (sent.parent / "wing.toml").write_text('[imu]\naxes = "forward right downn"\n')
    assert "wing.toml:2: imu.axes = 'forward right downn': 'downn' is no direction" in said(
        lambda: load_flight(file)
    )


def test_a_season_trusts_the_directory_of_each_flight(sent: Path) -> None:
    """Oracle: the secret lies in the directory that `insgnss batch` was given."""
    file = sent / "flight.toml"
    file.write_text(with_option(file.read_text(), "imu", "file", '"../words.txt"'))
    with trusting([sent.parent]):
        outcome = process_task(Task("sent", str(file), "", False, False, 0))
    assert "which is not shown" in str(outcome.row["reason"])
    assert SECRET not in str(outcome.row)


def test_home_is_that_of_the_first_parameter_however_the_call_orders_its_keywords(
    sent: Path,
) -> None:
    """Oracle: the secret, which lies in the home of the second argument."""

    @at_home
    def reads(path: Path, other: Path) -> object:
        return read_imu_csv(other)

    secret = sent.parent / "words.txt"
    assert SECRET not in said(lambda: reads(other=secret, path=sent / "flight.toml"))


def test_what_nobody_sent_is_shown(sent: Path) -> None:
    """Oracle: the line; a reader called by itself, and a file in the directory that is trusted."""
    secret = sent.parent / "words.txt"
    assert SECRET in said(lambda: read_imu_csv(secret))
    assert SECRET in said(lambda: at_home(lambda path: read_imu_csv(path))(secret))
    with trusting([sent / "no such file"]):
        assert SECRET in said(lambda: read_imu_csv(secret))
    with trusting([sent]):
        assert str(InputError(f"adjust: {SECRET}")) == f"adjust: {SECRET}"
        assert SECRET not in str(InputError(f"{secret}: {SECRET}"))
        assert "3 epochs" in str(DataError(f"{secret}: 3 epochs"))  # it could be read
        assert "does not exist" in said(lambda: read_toml(sent.parent / "none.toml", {}))
