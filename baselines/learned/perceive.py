"""What the head camera sees, as objects: place, sizes, turn, colour and kind of each.

Two small convolutional networks. One looks at the whole picture and finds the middles of objects;
the other looks at what is around each of them, sharply and from farther away, and measures. Both
are trained on drawn pictures alone; at a trial they get the picture and nothing else. The arms have
to be at home. Importing this module imports torch.

Letters in comments: B pictures, K objects, C channels.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from robospa.baselines.learned.act import the_bin
from robospa.baselines.learned.scenes import middle_pixel
from robospa.baselines.learned.steps import KINDS, Seen, model, table_top
from robospa.harness.running.atomic_file import replace_file
from robospa.workcell import HEIGHT, TABLE_TOP, WIDTH, WORKCELL

CELL = 8
"""Pixels along a side of the cells in which middles are looked for."""
SHIFTS = (0, CELL // 2)
"""A picture is looked at as it is, and once shifted by so many pixels right and down: what lies
between cells once does not the other time."""
HARDLY, LIKELY, APART = 0.02, 0.22, 8.0
"""How probable a cell has to be to count, and all cells of a middle together; middles are at least
so far [px] from each other."""
AROUND = 48
"""Pixels along a side of what is seen sharply; twice that is seen from farther away."""
BLOCK = KINDS.index("block")
NUMBERS = 16
"""Of a measurement: place 3, half sizes 3, turn 6, colour 3, hinge 1."""
SQUARE = 1.08
"""How much longer than wide what is about square may seem."""
EDGE = 8
"""In so many of the uppermost rows of cells the far edge of the table is seen."""
NEAR, UNIT = 0.03, 0.02
"""The height above the table [m] in which a pixel is looked up, and the unit of offsets [m]."""


def block_of(inner: int, outer: int, stride: int = 1, dilation: int = 1) -> nn.Sequential:
    """A convolution, with what makes it easy to train."""
    conv = nn.Conv2d(inner, outer, 3, stride, dilation, dilation, bias=False)
    return nn.Sequential(conv, nn.BatchNorm2d(outer), nn.ReLU(inplace=True))


class FindNetwork(nn.Module):
    """Pictures (B, 3, H, W), -0.5 to 0.5, to (B, 3, H / CELL, W / CELL): how likely a middle lies
    in each cell, as a logit, and where from the cell's middle [cells]; and to how much higher than
    usual the table is (B,) [UNIT], by where its far edge is seen."""

    def __init__(self, width: int = 48) -> None:
        super().__init__()
        self.first = nn.Sequential(nn.Conv2d(3, 24, 4, 4), nn.ReLU(), block_of(24, width, 2))
        self.deep = nn.ModuleList([block_of(width, width, 1, d) for d in (1, 2, 4, 2)])
        self.last = nn.Conv2d(width, 3, 1)
        self.rise = nn.Sequential(nn.Linear(EDGE * width, 64), nn.ReLU(), nn.Linear(64, 1))

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """See above."""
        x = self.first(images)
        for layer in self.deep:
            x = x + layer(x)
        edge = x[:, :, :EDGE].mean(dim=3).flatten(1)
        return self.last(x), self.rise(edge)[:, 0]


class MeasureNetwork(nn.Module):
    """What is around middles (K, 6, AROUND, AROUND), and their pixels (K, 2), to NUMBERS and kinds
    (K, NUMBERS + KINDS)."""

    def __init__(self, width: int = 48) -> None:
        super().__init__()
        w = width
        self.first = nn.Sequential(block_of(6, 32, 2), block_of(32, w, 2))
        self.second, self.third = block_of(w, w), nn.Sequential(block_of(w, 2 * w, 2))
        self.fourth = block_of(2 * w, 2 * w)
        self.joined = nn.Linear(2 * w * 36 + 5, 256)
        self.last = nn.Sequential(nn.ReLU(), nn.Linear(256, 256), nn.ReLU())
        self.out = nn.Linear(256, NUMBERS + len(KINDS))

    def forward(self, crops: Tensor, pixels: Tensor) -> Tensor:
        """See above."""
        x = self.first(crops)
        x = self.third(x + self.second(x))
        x = (x + self.fourth(x)).flatten(1)
        u, v = pixels[:, 0] / (WIDTH / 2) - 1, pixels[:, 1] / (HEIGHT / 2) - 1
        where = torch.stack([u, v, u * u, u * v, v * v], dim=1)
        out: Tensor = self.out(self.last(self.joined(torch.cat([x, where], dim=1))))
        return out


def as_input(images: NDArray[np.uint8]) -> Tensor:
    """(B, H, W, C) as a network reads it (B, C, H, W)."""
    return torch.from_numpy(images.astype(np.float32) / 255 - 0.5).permute(0, 3, 1, 2)


def around(
    image: NDArray[np.uint8], places: NDArray[np.float64]
) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """What is around places (K, 2: column, row) [px], sharp and from afar (K, AROUND, AROUND, 6);
    and the pixels that it is around (K, 2), the nearest in the picture."""
    pixels = places.round().clip(0, [WIDTH - 1, HEIGHT - 1]).astype(np.int64)
    size, half = 2 * AROUND, AROUND // 2
    padded = np.pad(image, ((AROUND, AROUND), (AROUND, AROUND), (0, 0)), mode="edge")
    made = np.empty((len(pixels), AROUND, AROUND, 6), np.uint8)
    for i, (u, v) in enumerate(pixels):
        wide = padded[v : v + size, u : u + size]
        made[i, ..., :3] = wide[half : half + AROUND, half : half + AROUND]
        made[i, ..., 3:] = wide.reshape(AROUND, 2, AROUND, 2, 3).mean(axis=(1, 3))
    return made, pixels


def table_place(pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K, 2): x and y [m] of what is seen at pixels (K, 2), NEAR above the table."""
    camera = WORKCELL.head
    forward, right, up = (np.array(axis) for axis in camera.axes)
    across = (pixels[:, :1] - WIDTH / 2) / camera.focal
    upward = (HEIGHT / 2 - pixels[:, 1:]) / camera.focal
    way = forward + across * right + upward * up
    far = (TABLE_TOP + NEAR - camera.position[2]) / way[:, 2:]
    return np.asarray((np.array(camera.position) + far * way)[:, :2])


def plain(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """`Seen` rows (K, SEEN_WIDTH) with blocks as nobody can tell them apart: the longer side is
    x, and the turn is between quarter turns."""
    made = rows.copy()
    block = made[:, 0] == BLOCK
    swap = block & (made[:, 4] < made[:, 5])
    made[swap, 4:6] = made[swap, 5:3:-1]
    made[swap, 7] += np.pi / 2
    folded = (made[:, 7] + np.pi / 2) % np.pi - np.pi / 2
    made[:, 7] = np.where(block, folded, made[:, 7])
    return made


def labels_of(rows: NDArray[np.float32], pixels: NDArray[np.float64]) -> Tensor:
    """(K, NUMBERS): what the measuring network should say of `Seen` rows seen at pixels."""
    rows = plain(rows)
    near = (rows[:, 1:3] - table_place(pixels)) / UNIT
    turns = [f(k * rows[:, 7]) for k in (1, 2, 4) for f in (np.cos, np.sin)]
    z, half = (rows[:, 3:4] - TABLE_TOP) / UNIT, np.log(rows[:, 4:7] / 0.03)
    parts = [near, z, half, np.stack(turns, axis=1), rows[:, 8:11], rows[:, 11:12]]
    return torch.from_numpy(np.concatenate(parts, axis=1).astype(np.float32))


def seen_of(numbers: NDArray[np.float64], pixels: NDArray[np.float64]) -> list[Seen]:
    """What the measuring network says (K, NUMBERS + KINDS) of pixels (K, 2), as objects."""
    places = table_place(pixels) + numbers[:, :2] * UNIT
    found = []
    bin_seen = the_bin()
    for row, (x, y) in zip(numbers, places, strict=True):
        a, b, c = (float(h) for h in 0.03 * np.exp(row[3:6]))
        kind, next_kind = (KINDS[int(k)] for k in np.argsort(-row[NUMBERS:])[:2])
        if kind == "dustbin":
            found.append(bin_seen)
            continue
        size = model(Seen(kind, (0.0, 0.0, 0.0), (a, b, c), 0.0, (0.0, 0.0, 0.0))).size
        if all(h > s for h, s in zip((a, b, c), size, strict=True)):
            kind = next_kind  # what is twice as large is what it lies in
        turns = [math.atan2(row[7 + 2 * i], row[6 + 2 * i]) / k for i, k in enumerate((1, 2, 4))]
        sure = [math.hypot(row[6 + 2 * i], row[7 + 2 * i]) > 0.6 for i in range(3)]
        if kind == "block":  # half turns of a bar, and quarter turns of a cube, look alike
            turn = turns[2] if a < SQUARE * b else turns[1]
        else:  # what is known but for half or quarter turns, next to what else is believed
            best = next((i for i in range(3) if sure[i]), 0)
            part = 2 * math.pi / (1, 2, 4)[best]
            turn = turns[best] + part * round((turns[0] - turns[best]) / part)
        red, green, blue = (float(value) for value in row[12:15].clip(0, 1))
        place, hinge = (float(x), float(y), float(TABLE_TOP + UNIT * row[2])), max(0.0, row[15])
        found.append(Seen(kind, place, (a, b, c), turn, (red, green, blue), float(hinge)))
    return found


def standing(seen: Sequence[Seen], top: float) -> list[Seen]:
    """What is seen, moved along the rays of its middles until its table is at height `top` [m]:
    how far away a thing is, is hardly seen, but they all stand on one table."""
    too_low = top - table_top([one.place[2] for one in seen])
    eye, moved = np.array(WORKCELL.head.position), []
    for one in seen:
        ray = np.array(one.place) + np.array([0.0, 0.0, one.half[2]]) - eye
        x, y, z = (np.array(one.place) + ray * (too_low / ray[2])).tolist()
        moved.append(one if one.kind == "dustbin" else replace(one, place=(x, y, z)))
    return moved


def find_losses(
    network: FindNetwork,
    images: Sequence[NDArray[np.uint8]],
    seen: Sequence[NDArray[np.float32]],
    quick: bool,
) -> dict[str, Tensor]:
    """Of finding the middles of what is `seen` in pictures; `quick` is less exact."""
    inputs = as_input(np.stack(images)).contiguous(memory_format=torch.channels_last)
    with torch.autocast("cpu", torch.bfloat16, quick):
        told, rises = network(inputs)
    told = told.float()
    rows, columns = told.shape[2:]
    cells = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=2) + 0.5
    right, near = np.zeros(told.shape, np.float32), np.zeros((len(images), 1, rows, columns))
    for i, items in enumerate(seen):
        ways = middle_pixel(items) / CELL - cells[:, :, None]
        far = np.abs(ways).max(axis=3)
        nearest = far.argmin(axis=2)[..., None]
        way = np.take_along_axis(ways, nearest[..., None], axis=2)[:, :, 0]
        far = np.take_along_axis(far, nearest, axis=2)[..., 0]
        right[i, 0], right[i, 1:], near[i, 0] = far <= 0.5, way.transpose(2, 0, 1), far < 1.5
    target, mask = torch.from_numpy(right), torch.from_numpy(near).float()
    count = target[:, 0].sum().clamp(min=1)
    found = F.binary_cross_entropy_with_logits(told[:, 0], target[:, 0], reduction="sum") / count
    away = (F.smooth_l1_loss(told[:, 1:], target[:, 1:], reduction="none", beta=0.1) * mask).sum()
    heights = [(table_top(items[:, 3]) - TABLE_TOP) / UNIT for items in seen]
    rise = F.smooth_l1_loss(rises.float(), torch.tensor(heights), beta=0.1)
    return {"found": found, "away": away / mask.sum().clamp(min=1), "rise": rise}


def measure_losses(
    network: MeasureNetwork,
    rng: np.random.Generator,
    images: Sequence[NDArray[np.uint8]],
    seen: Sequence[NDArray[np.float32]],
    quick: bool,
) -> dict[str, Tensor]:
    """Of measuring what is `seen` in pictures, looked at a little beside its middle."""
    crops, every = [], []
    for image, items in zip(images, seen, strict=True):
        pixels = middle_pixel(items) + rng.normal(0, 1.2, (len(items), 2))
        crop, near = around(image, pixels)
        crops.append(crop)
        every.append(near)
    where, rows = np.concatenate(every), np.concatenate(seen)
    inputs = as_input(np.concatenate(crops)).contiguous(memory_format=torch.channels_last)
    with torch.autocast("cpu", torch.bfloat16, quick):
        told = network(inputs, torch.from_numpy(where.astype(np.float32)))
    told = told.float()
    right = labels_of(rows, where.astype(np.float64))
    small = torch.from_numpy((rows[:, 4] < 0.15).astype(np.float32))[:, None]

    def off(a: int, b: int) -> Tensor:
        each = F.smooth_l1_loss(told[:, a:b], right[:, a:b], reduction="none", beta=0.02)
        return (each * small).mean()

    kind = F.cross_entropy(told[:, NUMBERS:], torch.from_numpy(rows[:, 0]).long())
    turn = F.mse_loss(told[:, 6:12], right[:, 6:12])
    parts = {"place": 2 * off(0, 3), "half": 4 * off(3, 6), "turn": turn, "color": off(12, 16)}
    return {**parts, "kind": 0.5 * kind}


def save_weights(network: nn.Module, path: Path) -> None:
    """Write a network's weights at half precision."""
    stream = io.BytesIO()
    state = network.state_dict()
    np.savez_compressed(stream, **{k: v.half().numpy() for k, v in state.items() if v.ndim})
    replace_file(path, stream.getvalue())


def load_weights(network: nn.Module, path: Path) -> None:
    """Read what `save_weights` wrote; the network is ready to be asked then."""
    with np.load(path) as kept:
        state = {name: torch.from_numpy(kept[name]).float() for name in kept.files}
    network.load_state_dict(state, strict=False)
    network.eval()


class Perceiver:
    """Says what a picture shows, with the weights in `folder`."""

    def __init__(self, folder: Path) -> None:
        self._find, self._measure = FindNetwork(), MeasureNetwork()
        load_weights(self._find, folder / "find.npz")
        load_weights(self._measure, folder / "measure.npz")

    def look(self, image: NDArray[np.uint8]) -> list[Seen]:
        """The objects in a head picture (H, W, 3), the surest first."""
        with torch.inference_mode():
            shifted = [np.pad(image, ((n, 0), (n, 0), (0, 0)), "edge") for n in SHIFTS]
            views = np.stack([one[: image.shape[0], : image.shape[1]] for one in shifted])
            found, rises = self._find(as_input(views))
            crops, near = around(image, middles(found.double().numpy()))
            told = self._measure(as_input(crops), torch.from_numpy(near.astype(np.float32)))
        seen = seen_of(told.double().numpy(), near.astype(np.float64))
        return standing(seen, TABLE_TOP + UNIT * float(rises[0]))


def middles(told: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K, 2): pixels of the middles that the finding network tells of (S, 3, rows, columns), a
    picture shifted by each of SHIFTS; the surest first. What means the same middle is added up."""
    likely = 1 / (1 + np.exp(-told[:, 0]))
    views, rows, columns = np.nonzero(likely > HARDLY)
    away = told[views, 1:, rows, columns]
    places = (np.stack([columns, rows], axis=1) + 0.5 + away) * CELL - np.array(SHIFTS)[views, None]
    found, total = np.zeros((0, 2)), np.zeros(0)
    shares = likely[views, rows, columns] / len(told)
    for k in np.argsort(-shares, kind="stable"):
        same = np.flatnonzero(np.hypot(*(found - places[k]).T) < APART)[:1]
        if len(same):
            total[same] += shares[k]
        else:
            found, total = np.vstack([found, places[k]]), np.append(total, shares[k])
    kept = np.argsort(-total, kind="stable")
    return np.asarray(found[kept][total[kept] > LIKELY])
