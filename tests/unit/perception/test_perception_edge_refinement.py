import numpy as np
import pytest
from perception_render import corners_of, look_down, official_code_of_tag_0, render

from companion.perception.camera_model import CameraModel
from companion.perception.edge_parameters import EdgeParameters
from companion.perception.edge_refinement import refine_corners

MATRIX = np.array([[460.0, 0, 319.5], [0, 460.0, 239.5], [0, 0, 1.0]])
STRAIGHT = np.zeros(5)
BENT = np.array([-0.12, 0.03, 0.0005, -0.0004, 0.0])


def camera(lens):
    return CameraModel(width=640, height=480, fx=460.0, fy=460.0, cx=319.5, cy=239.5, distortion=lens)


def trial(rng, *, side_px, tilt, lens=STRAIGHT, start=0.6, distance=1.0, off_axis=0.1, model=None, **picture):
    """Refine one rendered tag; give errors (4, 2) [px], outward error (4,) and the refinement."""
    turn, axis = rng.uniform(0, 2 * np.pi, 2)
    where = rng.uniform(-off_axis, off_axis, 2) * distance
    pose = look_down(distance, tilt=tilt, axis=axis, turn=turn, x=where[0], y=where[1])
    tag = (int(rng.integers(587)), side_px * distance / 460.0, 0.0, 0.0, 0.0)
    image = render([tag], pose, MATRIX, lens, board=0.75 * tag[1], rng=rng, samples=4, **picture)
    truth = camera(lens).project(corners_of(tag) @ pose[0].T + pose[1])
    guess = truth + rng.normal(0.0, start, (4, 2))
    result = refine_corners(image, guess[None], camera=model or camera(lens), parameters=EdgeParameters())
    error = result.corners[0] - truth
    outward = truth - truth.mean(axis=0)
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    return error, (error * outward).sum(axis=1), result


CONDITIONS = {
    "sharp": {"side_px": 90, "tilt": 0.4},
    "frontal": {"side_px": 90, "tilt": 0.0},
    "steep": {"side_px": 120, "tilt": 1.0, "blur": 0.6, "noise": 2.0},
    "blurred": {"side_px": 90, "tilt": 0.4, "blur": 1.5, "noise": 2.0},
    "moving": {"side_px": 90, "tilt": 0.3, "blur": 0.6, "noise": 2.0, "drift": np.array([0.005, 0.003, 0.0])},
    "uneven light": {"side_px": 120, "tilt": 0.3, "blur": 0.6, "noise": 2.0, "slope": 1.0},
    "dim": {"side_px": 90, "tilt": 0.3, "blur": 0.6, "noise": 2.0, "levels": (30.0, 75.0, 50.0)},
    "bent by the lens": {"side_px": 130, "tilt": 0.3, "blur": 0.6, "noise": 2.0, "lens": BENT, "off_axis": 0.3},
    "small": {"side_px": 32, "tilt": 0.2, "blur": 0.6, "noise": 2.0},
}


@pytest.mark.parametrize("name", CONDITIONS)
def test_corners_are_right_to_a_tenth_of_a_pixel_without_bias(name):
    rng = np.random.default_rng(11)
    errors, outward = [], []
    for _ in range(5):
        error, away, result = trial(rng, **CONDITIONS[name])
        assert result.refined.all()
        errors.append(error)
        outward.append(away)
    errors = np.array(errors)
    assert np.median(np.linalg.norm(errors, axis=2)) < 0.1
    tolerance = 0.02 + 3.0 * errors.std() / np.sqrt(errors.shape[0] * 4)
    assert np.abs(errors.mean(axis=(0, 1))).max() < tolerance  # no shift
    assert abs(np.mean(outward)) < max(tolerance, 0.03)  # no growth


def test_the_stated_sigma_is_honest():
    rng = np.random.default_rng(3)
    ratios = []
    for _ in range(40):
        error, _, result = trial(
            rng,
            side_px=rng.uniform(18, 110),
            tilt=rng.uniform(0, 0.8),
            blur=rng.uniform(0.4, 1.6),
            noise=rng.uniform(1, 6),
        )
        if result.refined[0]:
            ratios.append(np.sqrt((error**2).mean()) / result.sigma[0])
    assert len(ratios) >= 35
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.5
    assert 0.5 < np.median(ratios) < 1.4


def test_the_lens_must_be_known_for_bent_sides():
    setting = {**CONDITIONS["bent by the lens"], "side_px": 170, "off_axis": 0.15, "noise": 0.0}
    strong = np.array([-0.3, 0.1, 0.0, 0.0, 0.0])
    with_lens = [trial(np.random.default_rng(s), **{**setting, "lens": strong})[0] for s in range(2)]
    without = [
        trial(np.random.default_rng(s), **{**setting, "lens": strong, "model": camera(STRAIGHT)})[0] for s in range(2)
    ]
    assert np.sqrt(np.mean(np.square(with_lens))) < 0.06
    assert np.sqrt(np.mean(np.square(without))) > 3 * np.sqrt(np.mean(np.square(with_lens)))


def test_what_cannot_be_fitted_keeps_its_corners():
    flat = np.full((120, 160), 90, dtype=np.uint8)
    quads = np.array(
        [
            [[20, 20], [60, 20], [60, 60], [20, 60]],  # nothing there
            [[20, 20], [24, 20], [24, 24], [20, 24]],  # too small
            [[20, 20], [20, 60], [60, 60], [60, 20]],  # anticlockwise
            [[20, 20], [60, 20], [40, 20], [20, 60]],  # degenerate
            [[np.nan, 20], [60, 20], [60, 60], [20, 60]],
            [[-50, -50], [-10, -50], [-10, -10], [-50, -10]],  # outside
        ],
        dtype=float,
    )
    result = refine_corners(flat, quads, camera=None, parameters=EdgeParameters())
    assert not result.refined.any()
    assert np.isnan(result.sigma).all()
    np.testing.assert_array_equal(result.corners, quads)


def test_no_tags_give_no_corners():
    result = refine_corners(np.zeros((9, 9), np.uint8), np.zeros((0, 4, 2)), camera=None, parameters=EdgeParameters())
    assert result.corners.shape == (0, 4, 2)


def test_tags_do_not_disturb_one_another():
    rng = np.random.default_rng(5)
    tags = [(1, 0.1, 0.09, -0.09, 0.0), (2, 0.1, -0.09, 0.09, 0.6)]
    pose = look_down(0.8, tilt=0.3, axis=1.0)
    image = render(tags, pose, MATRIX, blur=0.6, noise=2.0, rng=rng, board=0.25)
    quads = np.array([camera(STRAIGHT).project(corners_of(tag) @ pose[0].T + pose[1]) for tag in tags])
    quads += rng.normal(0, 0.5, quads.shape)
    parameters = EdgeParameters(converged=1e-4, iterations=10)
    both = refine_corners(image, quads, camera=None, parameters=parameters)
    for k in range(2):
        alone = refine_corners(image, quads[k : k + 1], camera=None, parameters=parameters)
        np.testing.assert_allclose(both.corners[k], alone.corners[0], atol=0.02)


def test_the_renderer_draws_the_official_tags():
    assert official_code_of_tag_0() == 0xD5D628584
