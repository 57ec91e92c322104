"""One simulated flight with its image block, processed once for all tests of the room."""

import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

from insgnss.flight.config.block_file import BlockFile, load_block
from insgnss.flight.config.load import load_flight
from insgnss.flight.processing.pipeline import process
from insgnss.photogrammetry.block_adjustment.run import AdjustmentResult, adjust
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.image_block import BlockOptions


@dataclass(frozen=True)
class Flown:
    """A data set that was processed."""

    directory: Path

    @property
    def block(self) -> BlockFile:
        return load_block(self.directory / "block.toml")

    def copied(self, to: Path) -> "Flown":
        shutil.copytree(self.directory, to)
        return Flown(to)


@pytest.fixture(scope="session")
def flown(tmp_path_factory) -> Flown:
    directory = tmp_path_factory.mktemp("block") / "flight"
    block = BlockOptions(tie_points=30.0, control=10, check=5)
    write_dataset(directory, minutes=5.0, imu_rate=100.0, seed=4, start_in_air=True, block=block)
    process(load_flight(directory), write=True)
    return Flown(directory)


@pytest.fixture(scope="session")
def adjusted(flown) -> AdjustmentResult:
    return adjust(flown.block)
