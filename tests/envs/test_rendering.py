"""Rendering: frames without a display, a window with one, and what each shape on the picture stands for."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from grouser.envs.paths import circle, make_path, straight
from grouser.envs.rendering import Renderer
from grouser.envs.state import VehicleState
from grouser.terrain import (
    ConfigurationError,
    FloatArray,
    Ground,
    InvalidInputError,
    Mode,
    Patch,
    Rectangle,
    RigidTerrain,
    SlopedGround,
    SoilTerrain,
    TerrainField,
    TrackedVehicle,
    named,
    paint_field,
)

pygame = pytest.importorskip("pygame")

M113 = TrackedVehicle.preset("m113")
ROLLING = VehicleState.rolling(3.0, x=5.0)

Frame = NDArray[np.uint8]


def frame_of(renderer: Renderer, state: VehicleState = ROLLING, label: str = "") -> Frame:
    frame = renderer.draw(state, label=label)
    assert frame is not None
    return frame


def changed(before: Frame, after: Frame) -> NDArray[np.bool_]:
    """Pixels that differ, outside the panel of text."""
    differs: NDArray[np.bool_] = (before != after).any(axis=-1)
    differs[: before.shape[0] // 3, : before.shape[1] // 3] = False
    return differs


def red_share(frame: Frame) -> float:
    pixels = frame.astype(int)
    return float(((pixels[..., 0] > 150) & (pixels[..., 1] < 90) & (pixels[..., 2] < 80)).mean())


@pytest.fixture
def renderer() -> Renderer:
    return Renderer(straight(), M113, size=(480, 270))


class TestFrames:
    def test_shape_and_type(self, renderer: Renderer) -> None:
        frame = frame_of(renderer)
        assert frame.shape == (270, 480, 3)
        assert frame.dtype == np.uint8
        assert frame.flags.c_contiguous

    def test_needs_no_display(self) -> None:
        script = (
            "import os; os.environ['SDL_VIDEODRIVER'] = 'no-such-driver'\n"
            "from grouser.envs.paths import straight\n"
            "from grouser.envs.rendering import Renderer\n"
            "from grouser.envs.state import VehicleState\n"
            "from grouser.terrain import TrackedVehicle\n"
            "import sys; assert 'pygame' not in sys.modules\n"
            "assert Renderer(straight(), TrackedVehicle.preset('m113')).draw(VehicleState()) is not None\n"
            "import pygame; assert not pygame.display.get_init()\n"
        )
        done = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")

    def test_the_same_drive_gives_the_same_frames(self) -> None:
        drive = [replace(ROLLING, x=0.3 * i, time=0.1 * i) for i in range(4)]
        first, second = (Renderer(straight(), M113, size=(320, 180)) for _ in range(2))
        for state in drive:
            assert np.array_equal(frame_of(first, state), frame_of(second, state))

    @pytest.mark.parametrize("name", ["straight", "circle", "sine", "figure-eight", "iso-3888-1"])
    @pytest.mark.parametrize("vehicle", ["m113", "maxxii"])
    def test_draws_every_path_for_large_and_small(self, name: str, vehicle: str) -> None:
        machine = TrackedVehicle.preset(vehicle)
        renderer = Renderer(make_path(name, machine), machine, size=(200, 300))
        assert frame_of(renderer, VehicleState()).std() > 5.0

    def test_does_not_alter_the_frames_it_returned(self, renderer: Renderer) -> None:
        frame = frame_of(renderer)
        kept = frame.copy()
        renderer.draw(replace(ROLLING, x=30.0, time=1.0))
        assert np.array_equal(frame, kept)


class TestWhatTheFrameShows:
    def test_the_vehicle_stands_in_the_middle_to_scale(self, renderer: Renderer) -> None:
        still = VehicleState(x=2.5)
        turned = VehicleState(x=2.5, heading=np.pi / 2)
        rows, columns = np.nonzero(changed(frame_of(renderer, still), frame_of(renderer, turned)))
        per_meter = 270 / (6.0 * M113.contact_length)
        # Contact length and overall width differ, so that turning changes pixels up to half the longer side away.
        reach = max(np.abs(rows - 135).max(), np.abs(columns - 240).max()) / per_meter
        assert reach == pytest.approx(M113.contact_length / 2, abs=2.5 / per_meter)

    def test_bars_move_with_the_belt_and_only_on_its_side(self, renderer: Renderer) -> None:
        state = VehicleState(v_left=1.0)
        before = frame_of(renderer, state)
        rows, _ = np.nonzero(changed(before, frame_of(renderer, replace(state, time=0.1))))
        assert rows.size
        assert rows.max() < 135

    def test_a_slipping_belt_turns_red(self, renderer: Renderer) -> None:
        rolling = frame_of(renderer, VehicleState.rolling(3.0))
        renderer.reset()
        spinning = frame_of(renderer, VehicleState(v_left=3.0, v_right=3.0))
        assert red_share(spinning) > red_share(rolling) + 0.002

    def test_slip_is_against_the_ground_under_each_track(self, renderer: Renderer) -> None:
        half = M113.tread / 2
        turning = VehicleState(vx=3.0, yaw_rate=1.0, v_left=3.0 - half, v_right=3.0 + half)
        calm = red_share(frame_of(renderer, VehicleState.rolling(3.0)))
        assert red_share(frame_of(renderer, turning)) == pytest.approx(calm, abs=2e-4)

    def test_the_arrow_points_along_the_velocity(self, renderer: Renderer) -> None:
        still = frame_of(renderer, VehicleState())
        rows, columns = np.nonzero(changed(still, frame_of(renderer, VehicleState(vy=4.0, v_left=0.0))))
        assert rows.mean() < 125
        assert columns.mean() == pytest.approx(240, abs=5)

    def test_lanes_are_drawn_where_the_path_has_a_corridor(self) -> None:
        lanes = make_path("iso-3888-1", M113)
        with_lanes = frame_of(Renderer(lanes, M113), VehicleState(x=12.0))
        without = frame_of(Renderer(replace(lanes, corridor=None), M113), VehicleState(x=12.0))
        assert changed(with_lanes, without).mean() > 0.02

    def test_the_trail_grows_and_an_earlier_time_begins_a_new_one(self, renderer: Renderer) -> None:
        fresh = frame_of(renderer, replace(ROLLING, x=9.0, time=0.0))
        renderer.reset()
        for i in range(10):
            driven = frame_of(renderer, replace(ROLLING, x=float(i), time=0.1 * i))
        assert changed(fresh, driven)[:, :200].any()
        again = frame_of(renderer, replace(ROLLING, x=9.0, time=0.0))
        assert not changed(fresh, again).any()

    def test_a_trail_may_be_given(self, renderer: Renderer) -> None:
        bare = frame_of(renderer)
        given = renderer.draw(ROLLING, trail=[(0.0, 3.0), (5.0, 3.0), (9.0, 3.0)])
        assert given is not None
        assert changed(bare, given).any()

    def test_the_label_is_written_on_the_panel(self, renderer: Renderer) -> None:
        bare = frame_of(renderer)
        assert not np.array_equal(bare, frame_of(renderer, label="lete-sand, native"))


class TestWindow:
    @pytest.fixture
    def window(self, monkeypatch: pytest.MonkeyPatch) -> Iterator[Renderer]:
        monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
        renderer = Renderer(circle(), M113, mode="human", size=(320, 180), fps=200.0)
        yield renderer
        renderer.close()

    def test_shows_frames_and_returns_none(self, window: Renderer) -> None:
        assert window.draw(ROLLING) is None
        shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
        assert np.array_equal(shown, frame_of(Renderer(circle(), M113, size=(320, 180))))

    def test_keeps_the_frame_rate(self, window: Renderer) -> None:
        window._fps = 50.0
        window.draw(ROLLING)
        start = pygame.time.get_ticks()
        for _ in range(5):
            window.draw(ROLLING)
        assert pygame.time.get_ticks() - start >= 90

    def test_closing_the_window_ends_drawing_without_an_error(self, window: Renderer) -> None:
        window.draw(ROLLING)
        pygame.event.post(pygame.event.Event(pygame.QUIT))
        assert window.draw(ROLLING) is None
        assert not pygame.display.get_init()
        assert window.draw(ROLLING) is None

    def test_close_twice(self, window: Renderer) -> None:
        window.draw(ROLLING)
        window.close()
        window.close()
        assert not pygame.display.get_init()


class TestRefusals:
    def test_unknown_mode(self) -> None:
        with pytest.raises(ConfigurationError, match=r"unknown render mode 'humane'; did you mean 'human'"):
            Renderer(straight(), M113, mode="humane")  # type: ignore[arg-type]

    @pytest.mark.parametrize("size", [(0, 540), (960, 10)])
    def test_impossible_size(self, size: tuple[int, int]) -> None:
        with pytest.raises(InvalidInputError, match=r"(width|height) must lie in"):
            Renderer(straight(), M113, size=size)

    def test_a_closed_renderer_gives_no_frames(self, renderer: Renderer) -> None:
        renderer.close()
        with pytest.raises(InvalidInputError, match="closed"):
            renderer.draw(ROLLING)

    def test_a_missing_pygame_is_named_with_its_extra(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "pygame", None)
        with pytest.raises(ConfigurationError, match=r"'pygame-ce': pip install 'grouser\[render\]'"):
            Renderer(straight(), M113)


class TestGround:
    def view(self, ground: Ground | None, size: tuple[int, int] = (480, 270)) -> Frame:
        frame = Renderer(None, M113, size=size).draw(VehicleState(), ground=ground)
        assert frame is not None
        return frame

    def brightness(self, frame: Frame, x: float, y: float) -> float:
        """Mean brightness of a square of a metre about a place in m, whose middle no line of the grid crosses."""
        per_meter = frame.shape[0] / (6.0 * M113.contact_length)
        row, column = (round(side / 2 + offset * per_meter) for side, offset in zip(frame.shape, (-y, x), strict=False))
        half = round(per_meter / 2)
        return float(frame[row - half : row + half, column - half : column + half].mean())

    def test_is_the_darker_the_better_it_holds(self) -> None:
        frames = [self.view(RigidTerrain(mu)) for mu in (0.1, 0.4, 0.8)]
        shades = [self.brightness(frame, 3.0, -3.0) for frame in frames]
        assert shades == sorted(shades, reverse=True)

    def test_soil_and_rigid_ground_of_equal_grip_look_alike(self) -> None:
        """A soil without cohesion grips by tan φ."""
        soil, rigid = SoilTerrain(0.0, math.atan(0.5)), RigidTerrain(0.5)
        assert np.array_equal(self.view(soil), self.view(rigid))

    def test_patches_lie_where_they_are(self) -> None:
        """Ice to the upper right, seen with y upwards."""
        extent = (-40.0, 40.0, -40.0, 40.0)
        field = paint_field(named("asphalt"), extent, patches=[Patch(named("ice"), Rectangle(x_min=0.0, y_min=0.0))])
        frame = self.view(field)
        ice, *others = (self.brightness(frame, x, y) for x, y in ((8, 3), (8, -3), (-8, -3), (3, -3)))
        assert ice > max(others) + 40
        assert np.ptp(others) < 2

    def test_every_form_of_a_ground_looks_the_same(self) -> None:
        class Mine:
            mode: Mode = "rigid"

            def parameters_at(self, x: float, y: float) -> FloatArray:
                return named("asphalt").parameters

            def gradient_at(self, x: float, y: float) -> tuple[float, float]:
                return 0.0, 0.0

        terrain = named("asphalt")
        uniform = TerrainField.uniform(terrain, (-50.0, 50.0, -50.0, 50.0), spacing=0.7)
        for ground in (SlopedGround(terrain, 0.1), uniform, Mine()):
            assert np.array_equal(self.view(ground), self.view(terrain))

    def test_beyond_the_map_there_is_nothing(self) -> None:
        extent = (-40.0, 2.0, -40.0, 40.0)
        refusing = TerrainField.uniform(named("asphalt"), extent)
        frame, extended = self.view(refusing), self.view(replace(refusing, outside="extend"))
        assert self.brightness(frame, 9.0, -3.0) < self.brightness(frame, -3.0, -3.0) - 30
        assert self.brightness(extended, 9.0, -3.0) == pytest.approx(self.brightness(extended, -3.0, -3.0), abs=3)


class TestGaugeAndCommand:
    def test_the_gauge_shows_each_track(self) -> None:
        """A belt that is faster fills its bar to the right, one that is slower to the left."""
        renderer = Renderer(None, M113)
        still = frame_of(renderer, VehicleState())
        frame = frame_of(renderer, VehicleState(v_left=1.0, v_right=-1.0))
        corner = (frame != still).any(axis=-1)[440:, :200]
        rows, columns = np.nonzero(corner)
        middle = (rows.min() + rows.max()) / 2
        left_track, right_track = columns[rows < middle], columns[rows > middle]
        assert left_track.min() >= right_track.max() - 2
        assert np.ptp(left_track) == pytest.approx(np.ptp(right_track), abs=2)

    @pytest.mark.parametrize(("yaw_rate", "side"), [(0.4, -1), (0.0, 0), (-0.4, 1)])
    def test_the_command_is_where_it_leads_in_two_seconds(self, yaw_rate: float, side: int) -> None:
        """Against the circle's closed form."""
        speed, per_meter = 4.0, 540 / (6.0 * M113.contact_length)
        renderer = Renderer(None, M113)
        without, with_command = (
            renderer.draw(VehicleState(), command=command) for command in ((0.0, yaw_rate), (speed, yaw_rate))
        )
        assert without is not None
        assert with_command is not None
        differs = (without != with_command).any(axis=-1)
        differs[:200, :400] = False
        _, columns = np.nonzero(differs)
        x = 2 * speed if side == 0 else speed / yaw_rate * math.sin(2 * yaw_rate)
        end = 480 + x * per_meter
        assert columns.max() == pytest.approx(end, abs=0.15 * M113.contact_length * per_meter)
        y = 0.0 if side == 0 else speed / yaw_rate * (1 - math.cos(2 * yaw_rate))
        assert differs[round(270 - y * per_meter), round(end)]
