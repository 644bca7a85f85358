"""The learner `maps` with a tiny network: it learns, repeats itself to the bit, goes on, is served.

Part of `make test-models`: torch is in the models' environment alone.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from outside import PATIENT, ran, served
from primitive_rows import GRASP, ROBOT, START, grasping_episode, picture_with, written_set

from robospa.baselines.learned.maps.primitives import decisions_of
from robospa.baselines.learned.progress import read_losses
from robospa.clients import connect
from robospa.protocol.policy import TrialInfo

TINY = {"width": 16, "layers": 1, "batch": 4, "warmup": 2, "threads": 1, "held_out": 0.2}
TINY |= {"choices": 4, "compared": 4}

pytestmark = [pytest.mark.models, pytest.mark.timeout(600)]

TRAIN = """
import json, sys
from pathlib import Path
from robospa.baselines.learned.learner import CheckpointError
from robospa.baselines.learned.maps.learner import LEARNER
data, out, resume, options, part, stop = json.loads(sys.argv[1])
from robospa.baselines.learned.maps import choices, choosing, training
if options["steps"] < 100: choices.FOUND = 99.0  # so short a training finds no grasp
class Stopped(Exception): pass
kind = {"heat": training.Trainer, "choice": choosing.ChoiceTrainer}[part]
whole = kind._save
def save(self):
    whole(self)
    if stop and self.step >= stop: raise Stopped
kind._save = save
try: LEARNER.train([Path(data)], Path(out), resume, LEARNER.options(**options))
except Stopped: pass
except CheckpointError as error: print("refused:", error)
"""


NETWORK = """
import torch
from robospa.baselines.learned.maps.network import HEADS, MapsNetwork, PlacesLayer, _offsets
from robospa.baselines.learned.maps.settings import NetworkShape

rows, columns = 4, 6
offset = _offsets(rows, columns).view(rows * columns, -1)
assert offset.shape[1] == rows * columns // 4
assert 0 <= offset.min() and offset.max() < (2 * rows - 2) * (2 * columns - 2)
# one offset, one number: from (1, 1) to the four at (2, 2) is as from (1, 3) to that at (2, 4)
assert offset[1 * columns + 1, 1 * 3 + 1] == offset[1 * columns + 3, 1 * 3 + 2]
assert len(set(offset[:, 0].tolist())) == rows * columns, "other places, other offsets"

torch.manual_seed(0)
layer = PlacesLayer(16, (rows, columns))
x, told, hidden = torch.randn(2, 24, 16), torch.randn(2, 5, 16), torch.zeros(2, 5, dtype=bool)
hidden[:, 3:] = True
other = told.clone()
other[:, 3:] = 7
assert torch.equal(layer.placed(x, told, hidden), layer.placed(x, other, hidden)), "hidden words"
other[:, 2] = 7
assert not torch.equal(layer.placed(x, told, hidden), layer.placed(x, other, hidden))
with torch.no_grad():
    layer.liking[:, offset[0, 5]] = 50.0  # from the first place, look at the last four alone
    layer.joined.weight.normal_()
    moved = x.clone()
    moved[:, 0 * columns + 2] *= -3  # not among them
    one, two = (layer.placed(some, told, hidden)[:, 0] for some in (x, moved))
    assert torch.allclose(one, two, atol=1e-4), "nothing else is looked at"
    moved[:, 2 * columns + 4] *= -3
    assert not torch.allclose(one, layer.placed(moved, told, hidden)[:, 0], atol=1e-2)

shape = NetworkShape(words=9, width=16, layers=1)
network = MapsNetwork(shape, torch.ones(shape.rows, shape.columns))
maps = torch.zeros(1, shape.rows, shape.columns, 3, dtype=torch.uint8)
seen, deep, _ = network(maps, torch.tensor([[3, 4] + [0] * 38]), torch.zeros(1, 25))
assert seen.place.shape[2:] == shape.heat
assert deep.shape[2:] == (shape.rows // 8, shape.columns // 8)
"""


CHOICE = """
import numpy as np, torch
from robospa.baselines.learned.maps.chooser import Chooser
from robospa.baselines.learned.maps.network import DETAILS, Details, Seen
from robospa.baselines.learned.maps.orientation import CLASSES
from robospa.baselines.learned.maps.policy import MapsPolicy
from robospa.baselines.learned.maps.settings import About, MapsOptions
from robospa.baselines.learned.maps.spots import CROP

torch.manual_seed(0)
chooser = Chooser(words=9, width=16).eval()
crops = torch.randint(1, 255, (2, 3, CROP, CROP, 3), dtype=torch.uint8)
places, real = torch.rand(2, 3, 2) / 3, torch.tensor([[True] * 3, [True, True, False]])
words = torch.tensor([[3, 4] + [0] * 38] * 2)
with torch.inference_mode():
    said = chooser(crops, places, real, words)
    moved = chooser(crops, places + 0.1, real, words)
    turned = chooser(crops[:, [1, 0, 2]], places[:, [1, 0, 2]], real, words)
    alone = chooser(crops[1:, :2], places[1:, :2], real[1:, :2], words[1:])
assert torch.allclose(said, moved, atol=1e-4), "where they lie on the table plays no part"
assert torch.allclose(said[:, [1, 0, 2]], turned, atol=1e-5), "nor their order"
assert torch.allclose(said[1, :2], alone[0], atol=1e-5), "nor spots that are none"
assert said[1, 2] < -1e3

place = torch.full((1, 3, 56, 80), -20.0)
place[0, :, 20, 30], place[0, :, 30, 50] = 9.0, 8.0

class Warm:
    def __call__(self, maps, words, body):
        return Seen(torch.tensor([[9.0, 0, 0, 0]]), place, place), place, place
    def at(self, seen, deep, condition, kind, cell):
        return Details(torch.zeros(1, CLASSES), torch.zeros(1, 2), torch.zeros(1, DETAILS))

class Colder(torch.nn.Module):
    def forward(self, crops, places, real, words):
        return torch.tensor([[0.0, 1.0]])

observation = {"images": {"head": np.zeros((240, 320, 3), np.uint8)}, "instruction": "Pick it."}
observation["state"] = np.array([0.0] * 6 + [1.0] + [0.0] * 6 + [1.0], np.float32)
about = About("maps", MapsOptions(), ("pick",))
policy, plain = MapsPolicy(Warm(), about, "", Colder()), MapsPolicy(Warm(), about)
near = lambda choice, x, y: abs(choice.point[0] - x) + abs(choice.point[1] - y) < 1e-6
warm, cold = (-0.095, -0.055), (0.105, 0.045)
assert near(policy.choice(observation, []), *cold), "the first grasp is the chooser's"
assert near(policy.choice(observation, ["grasp"]), *warm), "later ones are the heat map's"
assert near(plain.choice(observation, []), *warm)
"""


@pytest.mark.parametrize("script", [CHOICE, NETWORK], ids=["first-grasp", "attention"])
def test_parts_of_the_network(script: str) -> None:
    ran("-c", script, limit=200)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written_set(tmp_path_factory.mktemp("set"), [grasping_episode(i) for i in range(24)])


def trained(
    data: Path,
    out: Path,
    resume: bool = False,
    part: str = "heat",
    stop: int = 0,
    **options: object,
) -> str:
    """Train a tiny network; what is printed. Stops as if killed after the checkpoint `stop` of a
    `part`."""
    words = json.dumps([str(data), str(out), resume, TINY | options, part, stop])
    return ran("-c", TRAIN, words, limit=500).stdout


def test_a_training_repeats_itself_and_goes_on_to_the_same_bits(data: Path, tmp_path: Path) -> None:
    for name in ("one", "two"):
        trained(data, tmp_path / name, steps=6, save=3)
    trained(data, tmp_path / "cut", steps=6, save=3, stop=3)
    assert json.loads((tmp_path / "cut" / "policy.json").read_text())["step"] == 3
    (tmp_path / "cut" / "network.pt").write_bytes(b"")  # as if killed between a checkpoint's files
    trained(data, tmp_path / "cut", resume=True, part="choice", stop=3, steps=6, save=3)
    assert json.loads((tmp_path / "cut" / "policy.json").read_text())["choice_step"] == 3
    trained(data, tmp_path / "cut", resume=True, steps=6, save=3)
    for file in ("network.pt", "chooser.pt"):
        weights = [(tmp_path / name / file).read_bytes() for name in ("one", "two", "cut")]
        assert weights[0] == weights[1] == weights[2]
    assert (
        read_losses(tmp_path / "one" / "choice") == read_losses(tmp_path / "cut" / "choice") != []
    )
    assert read_losses(tmp_path / "one") == read_losses(tmp_path / "cut")
    assert "refused" in trained(data, tmp_path / "one", steps=6, save=3), "without --resume"
    other = trained(data, tmp_path / "one", resume=True, steps=7, save=3)
    assert "of another training (options differ)" in other


def test_it_learns_where_the_object_is_and_is_served(data: Path, tmp_path: Path) -> None:
    trained(data, tmp_path / "out", steps=220, save=110, batch=8, rate=4e-3, choices=110)
    first, last = read_losses(tmp_path / "out")
    assert last["place_loss"] < first["place_loss"] < 7 and last["held_out_kind_share"] == 1
    assert last["held_out_place_share"] >= 0.5, "two thirds of a thousand places are beside it"
    assert read_losses(tmp_path / "out" / "choice")[-1]["held_out_choice_share"] >= 0.5
    words = ("robospa.baselines.learned.serve:create", tmp_path / "out")
    with served(*words) as url, connect(url, timeouts=PATIENT) as policy:
        policy.reset(TrialInfo("Pick_Blocks_Size", "aloha-agilex", "Pick the block.", 1))
        observation = {
            "images": {"head": picture_with(-0.15, -0.06, 11)},
            "state": START.astype(np.float32),
            "ee": np.zeros((2, 8), np.float32),
            "instruction": "Pick the block.",
            "step": 0,
        }
        chunk = policy.infer(observation)
    rows = np.concatenate([START[None].astype(np.float32), chunk])
    one = decisions_of(ROBOT, rows)[0].primitive
    assert one is not None and (one.kind, one.arm) == (GRASP.kind, GRASP.arm)
    assert np.hypot(one.point[0] + 0.15, one.point[1] + 0.06) < 0.04
