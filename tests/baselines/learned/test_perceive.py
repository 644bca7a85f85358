"""Pictures to objects: what is labelled, cut out, found and told."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from robospa.baselines.learned import perceive, scenes  # noqa: E402
from robospa.baselines.learned.steps import KINDS, Seen, pixel  # noqa: E402
from robospa.workcell import WORKCELL  # noqa: E402

MUG = Seen("mug", (0.1, -0.05, 0.74), (0.05, 0.04, 0.05), 0.7, (0.1, 0.2, 0.3))
CUBE = Seen("block", (-0.2, 0.1, 0.74), (0.02, 0.02, 0.02), 0.2, (1.0, 0.0, 0.0))
BAR = Seen("block", (0.0, 0.0, 0.74), (0.01, 0.03, 0.02), 0.2, (1.0, 0.0, 0.0))


def rows(*seen: Seen) -> perceive.NDArray[np.float32]:
    return np.array([scenes.seen_numbers(item) for item in seen], np.float32)


def test_a_pixel_leads_back_to_its_place_on_the_table() -> None:
    x, y = np.array([0.1, -0.3]), np.array([0.05, -0.2])
    height = 0.74 + perceive.NEAR
    pixels = np.stack(WORKCELL.head.pixel(x, y, height), axis=1)
    np.testing.assert_allclose(perceive.table_place(pixels), np.stack([x, y], axis=1), atol=1e-9)


def test_what_is_labelled_is_told_again() -> None:
    pixels = scenes.middle_pixel(rows(MUG, CUBE)).round()
    labels = perceive.labels_of(rows(MUG, CUBE), pixels).double().numpy()
    kinds = np.eye(len(KINDS))[[KINDS.index("mug"), KINDS.index("block")]]
    mug, cube = perceive.seen_of(np.concatenate([labels, kinds], axis=1), pixels)
    assert (mug.kind, cube.kind) == ("mug", "block")
    assert math.dist(mug.place, MUG.place) < 1e-6 and math.dist(mug.half, MUG.half) < 1e-6
    assert mug.turn == pytest.approx(0.7, abs=1e-6) and cube.turn == pytest.approx(0.2, abs=1e-6)


def test_a_thing_seen_much_too_large_is_what_it_lies_in() -> None:
    ball = Seen("garbage", (0.0, 0.0, 0.74), (0.04, 0.04, 0.06), 0.0, (1.0, 0.0, 0.0))
    pixels = scenes.middle_pixel(rows(ball))
    kinds = np.zeros((1, len(KINDS)))
    kinds[0, [KINDS.index("garbage"), KINDS.index("table_trash_bin")]] = 4.0, 3.0
    labels = perceive.labels_of(rows(ball), pixels).double().numpy()
    (told,) = perceive.seen_of(np.concatenate([labels, kinds], axis=1), pixels)
    assert told.kind == "table_trash_bin"


def test_a_block_is_labelled_along_its_longer_side() -> None:
    made = perceive.plain(rows(BAR))[0]
    assert made[4:6] == pytest.approx((0.03, 0.01))
    assert made[7] == pytest.approx(0.2 + math.pi / 2 - math.pi)


def test_what_is_seen_on_a_lower_table_is_where_it_was_seen() -> None:
    pile, bin_seen = replace(CUBE, place=(-0.2, 0.1, 0.78)), replace(MUG, kind="dustbin")
    seen = [MUG, CUBE, pile, replace(BAR, place=(0.1, 0.1, 0.742)), bin_seen]
    *moved, same = perceive.standing(seen, 0.715)
    assert same == bin_seen
    for old, new in zip(seen, moved, strict=False):
        assert pixel(new) == pytest.approx(pixel(old))
        assert new.place[2] - old.place[2] == pytest.approx(-0.025, abs=0.002)


def test_what_lies_around_the_picture_is_its_edge() -> None:
    image = np.zeros((240, 320, 3), np.uint8)
    image[:, :160] = 200
    made, pixels = perceive.around(image, np.array([[-2.0, 0.4], [319.0, 240.0]]))
    np.testing.assert_array_equal(pixels, [[0, 0], [319, 239]])
    assert made.shape == (2, perceive.AROUND, perceive.AROUND, 6)
    assert (made[0] == 200).all() and (made[1] == 0).all()


def test_two_middles_as_near_as_a_few_pixels_are_one() -> None:
    told = np.full((1, 3, 30, 40), -9.0)
    told[0, 1:] = 0.0
    told[0, 0, 10, 10], told[0, 0, 10, 11], told[0, 0, 20, 30] = 3.0, 2.0, 1.0
    told[0, 1, 10, 11] = -0.9
    np.testing.assert_allclose(perceive.middles(told), [[84, 84], [244, 164]])


def test_weights_are_kept_at_half_precision(tmp_path: Path) -> None:
    kept, found = perceive.FindNetwork(), perceive.FindNetwork()
    perceive.save_weights(kept, tmp_path / "find.npz")
    perceive.load_weights(found, tmp_path / "find.npz")
    image = torch.zeros(1, 3, 240, 320)
    with torch.inference_mode():
        torch.testing.assert_close(found(image), kept.eval()(image), atol=0.02, rtol=0.02)
