"""Every search draws the same examples, takes the time that a shared machine gives it, and nothing stays behind."""

import tempfile
from collections.abc import Iterator

import pytest
from hypothesis import settings

settings.register_profile("grouser", deadline=None, derandomize=True)
settings.load_profile("grouser")


@pytest.fixture(scope="session", autouse=True)
def temporary_files(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What libraries leave among the temporary files goes when pytest's own do, and none reports that it was used."""
    folder = str(tmp_path_factory.mktemp("temporary"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tempfile, "tempdir", folder)
        # Of child processes.
        patch.setenv("TMPDIR", folder)
        patch.setenv("ORT_DISABLE_TELEMETRY", "1")
        yield
