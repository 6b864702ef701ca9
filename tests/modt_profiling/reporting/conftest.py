import pytest

from tests.modt_profiling.reporting.test_run_report import write_run


@pytest.fixture
def run(tmp_path):
    """Directory of a run of 20 frames, with windows of a meter."""
    return write_run(tmp_path / "run", windows=True)
