"""A wrong attribute's error names the right one."""

import copy
import pickle

import pytest

from thumper.common.attribute_hints import HintedAttributes
from thumper.common.geometry import Pose2


class _Whole(HintedAttributes):
    _parts = {"pose": Pose2}  # noqa: RUF012
    battery_V = 7.4

    def forward(self) -> None: ...


@pytest.mark.parametrize(
    ("thing", "name", "hint"),
    [
        (Pose2(), "x", "use x_m"),
        (Pose2(), "x_mm", "use x_m"),
        (Pose2(), "heading", "use heading_deg"),
        (Pose2(), "yaw", "use theta_rad"),
        (Pose2(), "nothing", "choose from: apply, distance_m, heading_deg, inverse, theta_rad, x_m, y_m"),
        (_Whole(), "battery", "use battery_V"),
        (_Whole(), "x_m", "use pose.x_m"),
        (_Whole(), "y", "use pose.y_m"),
        (_Whole(), "backward", "use forward(-0.3)"),
        (_Whole(), "forwards", "use forward"),
        (_Whole(), "nothing", "choose from: battery_V, forward"),
    ],
)
def test_the_right_name(thing: object, name: str, hint: str) -> None:
    with pytest.raises(AttributeError) as raised:
        getattr(thing, name)
    assert str(raised.value) == f"{type(thing).__name__} has no {name!r}; {hint}"


def test_what_python_looks_for_is_just_missing() -> None:
    assert not hasattr(Pose2(), "_repr_html_")
    pose = Pose2(x_m=1.0)
    assert copy.deepcopy(pose) == pickle.loads(pickle.dumps(pose)) == pose


def test_python_adds_no_guess_of_its_own() -> None:
    """It guesses from the attributes of the object, and names those that begin with `_` as well."""
    with pytest.raises(AttributeError) as raised:
        Pose2().thta_rad  # type: ignore[attr-defined]  # noqa: B018
    assert raised.value.obj is None
