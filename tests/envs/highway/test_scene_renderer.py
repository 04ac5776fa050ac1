"""Pictures of the scenes: without a display, and showing what there is."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from grouser.envs import PathTrackingEnv, VehicleState
from grouser.envs.highway import OffRoadEnv, ParkingEnv

pytest.importorskip("pygame")

Frame = NDArray[np.uint8]


def frame_of(env: Any, **options: Any) -> Frame:
    env.reset(seed=0, options=options)
    frame: Frame = env.render()
    return frame


def count(frame: Frame, color: tuple[int, int, int]) -> int:
    return int((np.abs(frame.astype(int) - color).max(axis=-1) <= 6).sum())


@pytest.fixture
def parking(make_parking: Callable[..., ParkingEnv]) -> ParkingEnv:
    return make_parking("physics", render_mode="rgb_array")


def test_a_frame_is_an_image(parking: ParkingEnv) -> None:
    frame = frame_of(parking)
    assert frame.shape == (640, 960, 3)
    assert frame.dtype == np.uint8


def test_the_goal_turns_green_where_it_is_reached(parking: ParkingEnv) -> None:
    parking.reset(seed=0, options={"spot": 6, "state": VehicleState(x=-2.0, y=14.0, heading=math.pi / 2)})
    before = parking.render()
    *_, info = parking.step(np.zeros(2, np.float32))
    after = parking.render()
    assert info["is_success"]
    assert before is not None
    assert after is not None
    assert count(before, (38, 92, 168)) > 20
    assert count(after, (38, 92, 168)) == 0
    assert count(after, (40, 150, 70)) > 20


def test_y_points_up(parking: ParkingEnv) -> None:
    up, down = (frame_of(parking, state=VehicleState(y=y)) for y in (6.0, -6.0))
    rows = [
        np.flatnonzero((np.abs(each.astype(int) - (108, 122, 84)).max(axis=-1) <= 6).any(axis=1)) for each in (up, down)
    ]
    assert rows[0].max() < rows[1].min()


def test_the_hull_has_its_size(parking: ParkingEnv) -> None:
    frame = frame_of(parking, heading=0.0)
    # The outline of 4.86 m, in a picture of 66 m height.
    dark = (np.abs(frame.astype(int) - (44, 50, 36)).max(axis=-1) <= 30)[200:440, 350:610]
    columns = np.flatnonzero(dark.any(axis=0))
    assert np.ptp(columns) / (640 / 66) == pytest.approx(4.86, abs=0.3)


def test_slippery_patches_are_lighter(make_offroad: Callable[..., OffRoadEnv]) -> None:
    settings = {"terrain": "asphalt", "patch_terrains": ("ice",), "patch_radius": (6.0, 6.0), "obstacles": 0}
    with_patches, without = (
        frame_of(make_offroad("physics", render_mode="rgb_array", patches=patches, **settings)) for patches in (20, 0)
    )
    # Below the panel.
    assert np.mean(with_patches[300:]) > np.mean(without[300:]) + 5


def test_without_a_mode_it_says_so(make_parking: Callable[..., ParkingEnv]) -> None:
    env = make_parking("physics")
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None


def test_a_window(make_parking: Callable[..., ParkingEnv], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = make_parking("physics", render_mode="human")
    env.reset(seed=0)
    env.step(np.zeros(2, np.float32))
    assert env.render() is None
    env.close()


def test_the_ground_is_shaded_as_in_the_other_tasks(make_offroad: Callable[..., OffRoadEnv]) -> None:
    """Against a frame of the path-tracking environment on one of the grounds."""
    env = make_offroad("physics", terrain="asphalt", render_mode="rgb_array", patches=0, obstacles=0)
    task = PathTrackingEnv("physics", terrain="asphalt", render_mode="rgb_array")
    frames = frame_of(env, heading_offset=0.0), frame_of(task)
    # Right below the panel, beside road and path.
    colors = [
        Counter(map(tuple, frame[220:240, 40:300].reshape(-1, 3).tolist())).most_common(1)[0][0] for frame in frames
    ]
    assert colors[0] == colors[1]
