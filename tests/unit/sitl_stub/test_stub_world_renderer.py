"""Rendered pictures: where edges lie, what blurs, what covers what, how much noise."""

from __future__ import annotations

import dataclasses
import math

import apriltag
import cv2
import numpy as np
import pytest
from stub_world_support import (
    CAMERA,
    HEIGHT,
    PAD,
    above_pad,
    edge_offsets,
    exposure,
    on_board,
    target_config,
)

from sitl_stub.world.exposure import Exposure
from sitl_stub.world.light import Light, LightConfig
from sitl_stub.world.pads import Pad, Tag
from sitl_stub.world.photosensor import Photosensor
from sitl_stub.world.renderer import Renderer
from sitl_stub.world.textures import INK, PAPER, pad_texture, tag_modules
from sitl_stub.world.world import RenderedImager

WIDTH, HEIGHT_PX = CAMERA.intrinsics.width, CAMERA.intrinsics.height


def renderer(pad: Pad = PAD, *, sides: bool = True, contrast: float = 1.0, seed: int = 1) -> Renderer:
    targets = (target_config(pad, sides=sides),)
    return Renderer(CAMERA.intrinsics, targets, contrast=contrast, rng=np.random.default_rng(seed))


def imager(seed: int = 1, light: LightConfig | None = None) -> RenderedImager:
    rng = np.random.default_rng(seed)
    return RenderedImager(renderer(seed=seed), Light(light or LightConfig(), rng), Photosensor(CAMERA, rng))


def edges_of(shots: list[Exposure], drawer: Renderer, pad: Pad, blur: float = CAMERA.lens_blur) -> np.ndarray:
    """Give the offsets of all edges of tags wholly in view whose modules are larger than 5.5 px."""
    offsets = []
    for shot in shots:
        picture = cv2.GaussianBlur(drawer.render(shot), (0, 0), blur)
        scene = shot.at(shot.t_middle)
        for tag in pad.tags:
            corners = tag.corners_board()
            points = np.column_stack([corners, np.ones(4)]) @ scene.plane_in_cam(scene.boards[0]).T
            if points[:, 2].min() < 0.05:
                continue
            seen = CAMERA.intrinsics.project(points)
            side = np.linalg.norm(seen - np.roll(seen, 1, axis=0), axis=1).min()
            if seen.min() > 5 and seen[:, 0].max() < WIDTH - 6 and seen[:, 1].max() < HEIGHT_PX - 6 and side > 44:
                offsets.append(edge_offsets(picture, scene, corners))
    return np.array(offsets)


def shots(count: int, seed: int, *, rates: float = 0.0, speed: float = 0.0) -> list[Exposure]:
    rng = np.random.default_rng(seed)
    result = []
    for _ in range(count):
        height = float(np.exp(rng.uniform(math.log(0.2), math.log(2.3))))
        north, east = 0.25 * height * rng.uniform(-1.0, 1.0, 2)
        result.append(
            exposure(
                above_pad(height, north, east),
                (*rng.uniform(-0.2, 0.2, 2), rng.uniform(-3.0, 3.0)),
                rates=rates * rng.uniform(-1.0, 1.0, 3),
                velocity=speed * min(1.0, height) * rng.uniform(-1.0, 1.0, 3),
            )
        )
    return result


def test_edges_lie_where_exact_projection_puts_them() -> None:
    offsets = edges_of(shots(25, 2), renderer(), PAD)
    assert len(offsets) > 60
    assert np.abs(offsets).mean() < 0.01
    assert abs(offsets.mean()) < 0.004
    assert np.abs(offsets).max() < 0.05


def densely_sampled(shot: Exposure, left: int, top: int, columns: int, rows: int, each: int = 12) -> np.ndarray:
    """Give the light of a part of the picture from `each` by `each` points of the pad in each pixel; beside it NaN."""
    scene, texture = shot.at(shot.t_middle), pad_texture(PAD)
    within = (np.arange(each) + 0.5) / each - 0.5
    u = (left + np.arange(columns)[:, None] + within).ravel()
    v = (top + np.arange(rows)[:, None] + within).ravel()
    rays = CAMERA.intrinsics.rays(np.stack(np.meshgrid(u, v), axis=-1))
    texels = rays @ (texture.texel_from_plane() @ np.linalg.inv(scene.plane_in_cam(scene.boards[0]))).T
    x, y = (np.rint(texels[..., k] / texels[..., 2]).astype(int) for k in (0, 1))
    board = texture.levels[0]
    inside = (x >= 0) & (y >= 0) & (x < board.shape[1]) & (y < board.shape[0])
    values = np.where(inside, board[np.where(inside, y, 0), np.where(inside, x, 0)].astype(float), np.nan)
    return values.reshape(rows, each, columns, each).mean(axis=(1, 3))


@pytest.mark.parametrize(("height", "north", "pitch"), [(7.0, 0.3, 0.0), (6.5, -1.0, 0.2), (3.0, -5.0, 1.0)])
def test_a_small_print_is_as_if_sampled_densely(height: float, north: float, pitch: float) -> None:
    """From afar and aslant: edges fade as evenly as light does, or tags would seem larger than they are."""
    shot = exposure(above_pad(height, north), (0.0, pitch, 0.3))
    picture = renderer().render(shot)
    edge = on_board(shot.at(shot.t_middle), 0.36 * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]))
    left, top = np.ceil(edge.min(axis=0)).astype(int)
    columns, rows = np.floor(edge.max(axis=0)).astype(int) - (left, top)
    wanted = densely_sampled(shot, left, top, columns, rows)
    seen = picture[top : top + rows, left : left + columns]
    error = (seen - wanted)[np.isfinite(wanted)]
    assert error.size > 500
    assert float(np.sqrt(np.mean(error**2))) < 6.0
    assert abs(float(error.mean())) < 1.0


def test_motion_blur_is_centred_on_the_middle_of_the_exposure() -> None:
    offsets = edges_of(shots(12, 3, rates=2.0, speed=1.0), renderer(), PAD)
    assert len(offsets) > 25
    assert np.abs(offsets).mean() < 0.02
    assert abs(offsets.mean()) < 0.006


def test_tags_printed_at_an_angle_are_as_exact() -> None:
    tags = (Tag(id=5, size=0.25, x=0.15, y=-0.1, heading=0.6), Tag(id=6, size=0.12, x=-0.2, y=0.15, heading=-2.0))
    pad = dataclasses.replace(PAD, tags=tags)
    offsets = edges_of(shots(12, 4), renderer(pad), pad)
    assert len(offsets) > 8
    assert np.abs(offsets).mean() < 0.01


def test_the_print_has_the_exact_share_of_black() -> None:
    for heading in (0.0, 0.5 * math.pi, 0.4):
        tag = Tag(id=17, size=0.211, x=0.013, y=-0.027, heading=heading)
        texture = pad_texture(dataclasses.replace(PAD, tags=(tag,)), 1024)
        black = tag_modules(17).mean() * tag.size**2
        plain = pad_texture(dataclasses.replace(PAD, tags=(dataclasses.replace(tag, size=1e-6),)), 1024)
        missing = (plain.levels[0].astype(float) - texture.levels[0]).sum() * texture.texel**2
        assert missing / (0.985 * PAPER - INK) == pytest.approx(black, rel=0.02)


def test_upright_is_apriltags_own_print() -> None:
    official = [
        [1, 1, 0, 1, 0, 1],
        [0, 1, 1, 1, 0, 1],
        [0, 1, 1, 0, 0, 0],
        [1, 0, 1, 0, 0, 0],
        [0, 1, 0, 1, 1, 0],
        [0, 0, 0, 1, 0, 0],
    ]
    assert (1 - tag_modules(0))[1:7, 1:7].tolist() == official
    assert tag_modules(3)[[0, -1]].all()
    assert tag_modules(3)[:, [0, -1]].all()


def test_the_apriltag_library_reads_ids_and_corner_order() -> None:
    shot = exposure(above_pad(1.0), (0.08, -0.05, 0.7), pad_yaw=-0.4)
    image = imager().capture(shot, bad=False).image
    scene = shot.at(shot.t_middle)
    found = {
        tag["id"]: tag["lb-rb-rt-lt"][::-1] - 0.5 for tag in apriltag.apriltag("tag36h11", decimate=1.0).detect(image)
    }
    assert set(found) >= {8, 9, 10, 11}
    for tag in PAD.tags:
        if tag.id in found:
            assert np.abs(found[tag.id] - on_board(scene, tag.corners_board())).max() < 0.4


def test_the_print_is_right_at_touchdown_height() -> None:
    shot = exposure(above_pad(0.16), (0.02, 0.03, 0.3))
    image = imager().capture(shot, bad=False).image
    assert {tag["id"] for tag in apriltag.apriltag("tag36h11").detect(image)} == {8, 9, 10, 11}


def test_a_moving_pad_blurs_and_the_ground_does_not() -> None:
    drawer = renderer()
    still = drawer.render(exposure(above_pad(1.5)))
    moving = drawer.render(exposure(above_pad(1.5), pad_velocity=(3.0, 0.0)))
    sharp, smeared = (np.abs(np.diff(picture[160:320, 240:400], axis=0)).max() for picture in (still, moving))
    assert smeared < 0.6 * sharp
    assert np.abs(still[:, :40] - moving[:, :40]).max() < 1e-3


def test_the_platform_is_raised_and_shows_its_sides() -> None:
    shot = exposure((-1.5, 0.0, -1.5), (0.0, 0.6, 0.0))  # looks ahead at the pad's near edge
    scene = shot.at(shot.t_middle)
    foot = np.array([[-0.4, 0.0, 0.0], [-0.4, 0.0, -0.5 * HEIGHT], [-0.4, 0.0, -HEIGHT]])  # up its near side, ned
    u, v = CAMERA.intrinsics.project((foot - scene.camera_ned) @ scene.ned_from_cam).T
    assert v[0] - v[2] > 20  # px from ground to top
    with_sides, without = (renderer(sides=sides).render(shot) for sides in (True, False))
    row, column = round(v[1]), round(u[1])
    patch = with_sides[row - 3 : row + 4, column - 10 : column + 11]
    assert patch.std() < 0.5
    assert without[row - 3 : row + 4, column - 10 : column + 11].std() > 0.5
    below = slice(round(v[0]) + 3, None)
    assert np.array_equal(with_sides[below, column], without[below, column])


@pytest.mark.parametrize("attitude", [(1.2, 0.0, 0.0), (0.0, -1.5, 0.4), (math.pi, 0.0, 0.0), (0.3, 2.0, 1.0)])
def test_any_attitude_gives_a_picture(attitude: tuple[float, float, float]) -> None:
    for position in (above_pad(1.0), above_pad(0.02), (0.0, 0.0, -0.05), (0.0, 0.0, 0.2), (300.0, -200.0, -40.0)):
        picture = renderer().render(exposure(position, attitude))
        assert np.isfinite(picture).all()
        assert picture.min() >= 0.0
        assert picture.max() <= 255.0


def test_a_picture_of_an_odd_size_is_whole() -> None:
    lens = dataclasses.replace(CAMERA.intrinsics, width=333, height=251, cx=166.0, cy=125.0)
    drawer = Renderer(lens, (target_config(),), contrast=1.0, rng=np.random.default_rng(0))
    picture = drawer.render(exposure(above_pad(0.5), camera=dataclasses.replace(CAMERA, intrinsics=lens)))
    assert picture.shape == (251, 333)
    assert picture[-1, -1] > 0.0


def test_the_ground_repeats_where_a_look_ahead_leaves_the_texture(monkeypatch: pytest.MonkeyPatch) -> None:
    ahead = exposure((20.0, 13.0, -0.3), (0.0, 1.45, 0.4))  # the picture's top is the sky
    folded = renderer().render(ahead)
    monkeypatch.setattr("sitl_stub.world.renderer._fold", lambda *_: None)
    wrapped = renderer().render(ahead)  # by OpenCV, which loses count far away
    assert np.quantile(np.abs(folded - wrapped), 0.99) <= 2.0
    assert wrapped[: HEIGHT_PX // 4].std() == 0.0
    assert wrapped[-HEIGHT_PX // 4 :].std() > 8.0


def test_the_ground_has_contrast_at_every_height() -> None:
    for height in (0.05, 0.3, 1.0, 4.0, 15.0):
        picture = renderer().render(exposure((20.0, 13.0, -height)))
        assert picture.std() > 8.0
    assert renderer(contrast=0.0).render(exposure((20.0, 13.0, -3.0))).std() < 0.1


def test_noise_is_read_noise_and_shot_noise() -> None:
    config = dataclasses.replace(CAMERA, vignetting=0.0)
    sensor = Photosensor(config, np.random.default_rng(0))
    for level in (10.0, 80.0, 200.0):
        flat = np.full((HEIGHT_PX, WIDTH), level, dtype=np.float32)
        one, two = (sensor.develop(flat, np.ones_like(flat), 1.0, bad=False).astype(float) for _ in range(2))
        expected = config.read_noise**2 + level * 255.0 / config.full_well + 1.0 / 12.0
        assert (one - two).var() / 2.0 == pytest.approx(expected, rel=0.05)
        assert one.mean() == pytest.approx(level, abs=0.1)
        assert abs(np.corrcoef((one - level).ravel(), (two - level).ravel())[0, 1]) < 0.3  # fixed pattern only


def test_vignetting_darkens_the_corners_and_light_is_uneven() -> None:
    sensor = Photosensor(CAMERA, np.random.default_rng(0))
    flat = np.full((HEIGHT_PX, WIDTH), 150.0, dtype=np.float32)
    image = sensor.develop(flat, np.ones_like(flat), 1.0, bad=False).astype(float)
    assert image[:20, :20].mean() == pytest.approx(150.0 * (1.0 - CAMERA.vignetting), rel=0.03)
    assert image[230:250, 310:330].mean() == pytest.approx(150.0, rel=0.01)
    light = Light(LightConfig(), np.random.default_rng(1))
    north, east = np.meshgrid(np.linspace(-8, 8, 100), np.linspace(-8, 8, 100))
    assert 0.08 < light.on_ground(north, east).std() < 0.25


def test_the_exposure_wanders_slowly() -> None:
    light = Light(LightConfig(), np.random.default_rng(2))
    level = np.log([light.exposure(k / 30.0) for k in range(20000)])
    assert level.mean() == pytest.approx(math.log(0.85), abs=0.03)
    assert level.std() == pytest.approx(0.06, rel=0.25)
    assert np.abs(np.diff(level)).max() < 0.05


def test_spoilt_pictures_differ_from_good_ones() -> None:
    maker, shot = imager(), exposure(above_pad(1.0))
    good = maker.capture(shot, bad=False).image.astype(float)
    spoilt = [maker.capture(shot, bad=True).image.astype(float) for _ in range(12)]
    assert all(np.abs(image - good).mean() > 5.0 for image in spoilt)
    assert len({round(image.mean() / 10.0) for image in spoilt}) >= 3


def test_the_same_seed_gives_the_same_bytes() -> None:
    def pictures(seed: int) -> bytes:
        maker = imager(seed)
        return b"".join(maker.capture(shot, bad=False).image.tobytes() for shot in shots(3, 9, rates=1.0))

    assert pictures(4) == pictures(4)
    assert pictures(4) != pictures(5)
