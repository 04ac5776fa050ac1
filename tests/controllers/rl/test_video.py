"""Films: as many frames as an episode has, read back from the file."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from policies import make_policy

from grouser.controllers.rl import film
from grouser.terrain import ConfigurationError, InvalidInputError

TASK: dict[str, Any] = {"action_mode": "twist", "time_limit": 0.5}


def test_a_film_shows_every_control_period_in_real_time(tmp_path: Path) -> None:
    pytest.importorskip("pygame")
    pytest.importorskip("imageio_ffmpeg")
    import imageio.v2

    policy = make_policy(**TASK)
    told: list[int] = []
    target = tmp_path / "new folder" / "drive.mp4"
    frames = film(policy, policy.environment_spec(), target, episodes=2, progress=told.append)
    # A frame before the first step and one after each.
    assert frames == 12
    assert told == [*range(1, 13)]
    reader: Any = imageio.v2.get_reader(target)
    assert reader.count_frames() == 12
    assert reader.get_meta_data()["fps"] == 10
    reader.close()
    assert [file.name for file in target.parent.iterdir()] == ["drive.mp4"]


def test_a_film_ends_in_mp4(tmp_path: Path) -> None:
    policy = make_policy(**TASK)
    with pytest.raises(InvalidInputError, match=r"\.mp4"):
        film(policy, policy.environment_spec(), tmp_path / "drive.avi")


def test_a_missing_library_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    policy = make_policy(**TASK)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ConfigurationError, match=r"grouser\[render\]"):
        film(policy, policy.environment_spec(), tmp_path / "drive.mp4")
