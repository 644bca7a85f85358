"""Words and objects to the next step: order never matters, unknown words mean something."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from robospa.baselines.learned import point, train  # noqa: E402
from robospa.baselines.learned.perceive import save_weights  # noqa: E402
from robospa.baselines.learned.scenes import lesson  # noqa: E402
from robospa.baselines.learned.steps import TYPES, State, Step, labelled, taken  # noqa: E402
from robospa.baselines.learned.train import States, point_losses  # noqa: E402
from robospa.tasks.catalog import build_scene  # noqa: E402
from robospa.tasks.colors import NAMED  # noqa: E402

SCENE = build_scene("Stack_Blocks_Color_Order", 3, 1_500_000)
WORDS = ("stack", "the", "red", "block", "left")


@pytest.fixture
def pointer(tmp_path: Path) -> point.Pointer:
    torch.manual_seed(0)
    (tmp_path / "words.json").write_text(json.dumps(WORDS))
    save_weights(point.PointNetwork(point.FIRST_WORD + len(WORDS)), tmp_path / "point.npz")
    return point.Pointer(tmp_path)


def test_unknown_words_are_near_those_that_mean_the_same() -> None:
    def alike(one: str, other: str) -> float:
        return float(point.meaning(one) @ point.meaning(other))

    assert alike("leftmost", "left") > 0.7 > 0.4 > alike("leftmost", "right")
    assert alike("biggest", "largest") > 0.6 > alike("biggest", "stapler")
    vocabulary = point.Vocabulary(WORDS)
    assert vocabulary.numbers("Stack 2nd")[:4].tolist() == [2, point.UNKNOWN, point.UNKNOWN, 0]
    np.testing.assert_array_equal(vocabulary.table[2], vocabulary.meanings("stack")[0])
    near = [vocabulary.table[i] @ vocabulary.table[4] for i in vocabulary.synonyms[4]]
    assert max(near) == pytest.approx(1) and 1 > near[1] > point.ALIKE  # "red" has others


def test_colours_know_their_names() -> None:
    shares = point.names_of_colors(torch.tensor([*NAMED.values()]))
    assert shares.argmax(dim=1).tolist() == list(range(len(NAMED)))


def test_the_order_of_objects_means_nothing(pointer: point.Pointer) -> None:
    for state, _ in labelled(SCENE):
        step = pointer.next_step(replace(state, done=()), "stack the red block")
        other = pointer.next_step(State(state.objects[::-1]), "stack the red block")
        numbers = [*reversed(range(len(state.objects))), None]
        goal = None if step.destination is None else numbers[step.destination]
        assert other == replace(step, object=numbers[step.object or 0], destination=goal)
    assert pointer.next_step(State(()), "stack") == Step("done")


def test_nothing_is_moved_to_where_something_lies(
    pointer: point.Pointer, monkeypatch: pytest.MonkeyPatch
) -> None:
    network, state = pointer._network, labelled(SCENE)[0][0]
    with torch.no_grad():
        network.deed[-1].bias[TYPES.index("move")] += 99
        network.none[-1].bias += 99
    number = pointer.next_step(state, "stack").object
    assert number is not None
    (lies, far), *_ = taken(state, number)
    heat = -np.hypot(*(point.cell_places() - lies).T)
    monkeypatch.setattr(network, "heat_of", lambda *_: torch.from_numpy(heat)[None])
    place = pointer.next_step(state, "stack").place
    assert place is not None and far <= math.dist(place, lies) < far + point.CELL


def test_phrases_of_training_sentences_are_said_in_other_ways(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said = "Pick up the 2nd cup from left to right, quick."
    rng, seen = np.random.default_rng(0), set[str]()
    monkeypatch.setattr(train, "SAID_ANEW", (0.0,))
    assert train.paraphrased(rng, said) == " ".join(point.words_of(said))
    monkeypatch.setattr(train, "SAID_ANEW", (1.0,))
    seen |= {train.paraphrased(rng, said) for _ in range(30)}
    assert len(seen) > 10 and all(text.endswith(" quick") for text in seen)
    assert not any("from left to right" in text or "right left" in text for text in seen)
    longest = max(map(len, train.paraphrases()))
    assert longest <= train.LONGEST_PHRASE and all(train.paraphrases().values())


def test_a_loss_falls() -> None:
    states = States([lesson(SCENE)], point.Vocabulary(WORDS))
    network = point.PointNetwork(point.FIRST_WORD + len(WORDS))
    optimizer = torch.optim.Adam(network.parameters(), 3e-3)
    seen = []
    for _ in range(20):
        drawn = states.draw(np.random.default_rng(0), 8)
        loss = sum(point_losses(network, *drawn).values(), torch.zeros(()))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        seen.append(float(loss.detach()))
    assert seen[-1] < 0.7 * seen[0]
