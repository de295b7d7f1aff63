"""The same random cases in every run, and no deadline: speed is measured in benchmarks/. Files for the tests of readers."""

import pytest
from hypothesis import settings

settings.register_profile("house", deadline=None, derandomize=True, database=None)
settings.load_profile("house")


@pytest.fixture
def log_file(tmp_path):
    """A log of a joint, as NPZ."""
    from _log_files import motion, write_npz

    write_npz(tmp_path / "log.npz", motion())
    return tmp_path / "log.npz"


@pytest.fixture(scope="session")
def slow_file(tmp_path_factory):
    """A file that takes about half a second to parse."""
    path = tmp_path_factory.mktemp("slow") / "slow.json"
    path.write_text('{"t":[' + "0.125," * 6_000_000 + "1]}")
    return path
