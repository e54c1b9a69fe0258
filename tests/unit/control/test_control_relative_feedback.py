"""The feedback removes a constant disturbance and keeps its bounds."""

import numpy as np

from companion.control.relative_feedback import RelativeFeedback, RelativeFeedbackParameters


def _settle(
    parameters: RelativeFeedbackParameters, disturbance: float, duration: float = 20.0, *, calm: bool = False
) -> float:
    """Fly a double integrator with PX4's own soft loop and a constant push; give the last error [m]."""
    feedback, dt = RelativeFeedback(parameters), 0.02
    position = velocity = 0.0
    for _ in range(int(duration / dt)):
        error, rate = np.array([-position, 0.0, 0.3]), np.array([-velocity, 0.0, 0.0])
        correction = feedback.update(error, rate, np.zeros(3), dt, calm=calm)
        assert correction[2] == 0.0
        assert np.hypot(correction[0], correction[1]) <= parameters.acceleration_max_mps2 + 1e-12
        acceleration = 1.8 * (-0.95 * position - velocity) + float(correction[0]) + disturbance
        velocity += acceleration * dt
        position += velocity * dt
    return abs(position)


def test_a_constant_push_leaves_no_error() -> None:
    assert _settle(RelativeFeedbackParameters(), 0.5) < 0.005
    assert _settle(RelativeFeedbackParameters(integral=0.0), 0.5) > 0.05


def test_it_forgets_on_reset() -> None:
    feedback = RelativeFeedback(RelativeFeedbackParameters())
    error = np.array([0.2, -0.1, 0.0])
    first = feedback.update(error, np.zeros(3), np.zeros(3), 0.02)
    for _ in range(50):
        feedback.update(error, np.zeros(3), np.zeros(3), 0.02)
    feedback.reset()
    np.testing.assert_array_equal(feedback.update(error, np.zeros(3), np.zeros(3), 0.02), first)


def test_while_following_it_is_softer_by_the_share_and_still_leaves_no_error() -> None:
    parameters = RelativeFeedbackParameters(integral=0.0, following=0.5)
    error, rate = np.array([0.1, 0.0, 0.0]), np.array([0.0, -0.1, 0.0])
    firm = RelativeFeedback(parameters).update(error, rate, np.zeros(3), 0.02)
    soft = RelativeFeedback(parameters).update(error, rate, np.zeros(3), 0.02, calm=True)
    np.testing.assert_allclose(soft, 0.5 * firm)
    assert _settle(RelativeFeedbackParameters(), 0.5, calm=True) < 0.005
