"""Every mistake of convention is named; right policies are not accused."""

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import standins
from command_line import robospa
from replay_fakes import (
    CHUNK,
    EE,
    FRAMES,
    OFFSETS,
    SPEC,
    Change,
    Learned,
    all_images,
    columns,
    episode,
    grippers,
    joints,
    state,
    swapped_wrists,
)

from robospa.action_space import ActionSpace
from robospa.geometry import Pose
from robospa.harness.convention_check.action_faults import GRIPPERS, from_pose
from robospa.harness.convention_check.check import Findings, check_conventions
from robospa.harness.convention_check.episodes import (
    Episode,
    EpisodeError,
    read_episode,
    to_jpeg,
    write_episode,
)
from robospa.observation import DEFAULT_CAMERAS, CameraSpec
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.registry import POLICIES, names

MADE = episode()


def found(policy: Learned, made: Any = MADE) -> Findings:
    return check_conventions(policy, made)


SWAP = columns([*range(7, 14), *range(7)])


def per_step(chunk: Any, now: Any) -> Any:
    return np.diff(np.vstack([now, chunk]), axis=0)


def flip_motion(chunk: Any, now: Any) -> Any:
    out = chunk.copy()
    out[:, [1, 2, 8, 9]] = 2 * now[[1, 2, 8, 9]] - out[:, [1, 2, 8, 9]]
    return out


ANSWERS: dict[str, Change] = {
    "arms swapped": SWAP,
    "grippers last": columns([*range(6), *range(7, 13), 6, 13]),
    "grippers first": columns([6, *range(6), 13, *range(7, 13)]),
    "arms interleaved": columns([i + 7 * arm for i in range(7) for arm in (0, 1)]),
    "joints reversed": columns([5, 4, 3, 2, 1, 0, 6, 12, 11, 10, 9, 8, 7, 13]),
    "joint order": columns([1, 0, 2, 3, 5, 4, 6, 8, 7, 9, 10, 12, 11, 13]),
    "degrees": joints(np.degrees),
    **{
        f"gripper {name}": grippers(lambda g, shut=shut, wide=wide: shut + (wide - shut) * g)
        for name, (shut, wide) in GRIPPERS.items()
        if name != "0..0.045"  # nearly 0..0.1
    },
    "delta from the start": lambda chunk, now: joints(lambda c: c - now)(chunk, now),
    "delta from the last": lambda chunk, now: joints(lambda c: per_step(c, now))(chunk, now),
    "joint signs": joints(lambda c: c * np.where(np.isin(np.arange(14), [1, 2, 8, 9]), -1, 1)),
    "signs of motion": flip_motion,
    "a frame late": lambda chunk, now: np.vstack([now, chunk[:-1]]),
}


LOOKS = {
    "wrist images swapped": swapped_wrists,
    "blue for red": all_images(lambda image: image[..., ::-1]),
    "images upside down": all_images(lambda image: image[::-1, ::-1]),
    "arms of the state swapped": state(lambda rows: rows[::-1]),
    "grippers of the state inverted": state(lambda rows: np.hstack([rows[:, :6], 1 - rows[:, 6:]])),
    "state in degrees": state(lambda rows: np.hstack([np.radians(rows[:, :6]), rows[:, 6:]])),
}


def each_pose(change: Callable[[Pose, Pose], Pose]) -> Change:
    """Every pose of an arm, and its pose at the query, through `change`."""

    def changed(chunk: Any, now: Any) -> Any:
        out = chunk.copy().reshape(-1, 2, 8)
        for arm, start in enumerate(now.reshape(2, 8)):
            for row in out[:, arm]:
                made = change(*(Pose(tuple(p[:3]), tuple(p[3:7])) for p in (row, start)))
                row[:7] = *made.position, *made.rotation
        return out.reshape(chunk.shape)

    return changed


PLACES = np.arange(16) % 8 < 3
POSES: dict[str, Change] = {
    "quaternion x y z w": columns([0, 1, 2, 4, 5, 6, 3, 7, 8, 9, 10, 12, 13, 14, 11, 15]),
    "quaternion slip": columns([0, 1, 2, 6, 3, 4, 5, 7, 8, 9, 10, 14, 11, 12, 13, 15]),
    "millimetres": lambda chunk, now: chunk * np.where(PLACES, 1000.0, 1.0),
    "another origin": lambda chunk, now: chunk + np.where(PLACES, 0.4, 0.0),
    "tool centre": each_pose(lambda pose, now: Pose(pose.apply((0.12, 0.0, 0.0)), pose.rotation)),
    "pose in the hand's frame": each_pose(lambda pose, now: now.inverse() * pose),
    "position delta from the start": lambda chunk, now: chunk - np.where(PLACES, now, 0.0),
    "position delta from the last": lambda chunk, now: np.where(
        PLACES, per_step(chunk, now), chunk
    ),
    "gripper 0..0.1": lambda chunk, now: chunk * np.where(np.arange(16) % 8 == 7, 0.1, 1.0),
}


MISTAKES = [
    *(((name,), Learned(MADE, change)) for name, change in ANSWERS.items()),
    *(((name,), Learned(MADE, look=change)) for name, change in LOOKS.items()),
    *(((name,), Learned(MADE, change, spec=EE)) for name, change in POSES.items()),
    *(
        ((name,), Learned(MADE, ANSWERS[name], noise=0.02))
        for name in ("arms swapped", "degrees", "gripper inverted", "joint order")
    ),
    (
        ("arms swapped", "gripper inverted"),
        Learned(MADE, lambda chunk, now: ANSWERS["gripper inverted"](SWAP(chunk, now), now)),
    ),
    (
        ("arms of the state swapped", "arms swapped"),
        Learned(MADE, SWAP, look=LOOKS["arms of the state swapped"]),
    ),
]


@pytest.mark.parametrize(
    ("names", "policy"), MISTAKES, ids=["+".join(names) for names, _ in MISTAKES]
)
def test_mistakes_in_what_is_shown_and_in_the_answer_are_named(
    names: tuple[str, ...], policy: Learned
) -> None:
    findings = found(policy)
    assert findings.kind == "mistaken" and findings.best is not None
    assert findings.best.names == names and findings.best.phrase in findings.sentence
    assert ("adapt_to_pi" in findings.sentence) == ("sign" in names[0])


def test_a_policy_of_measured_joints_is_told_from_one_of_commands() -> None:
    assert MADE.measured is not None
    made = replace(MADE, commanded=MADE.measured)  # what it learned to follow
    late = replace(MADE, measured=MADE.measured)
    knows = Learned(made, look=lambda seen: {**seen, "state": made.commanded[seen["step"]]})
    findings = found(knows, late)
    assert findings.best is not None and findings.best.names == ("measured joints",)


@pytest.mark.parametrize("noise", [0.0, 0.03])
@pytest.mark.parametrize("spec", [SPEC, EE], ids=["joint", "ee"])
def test_a_right_policy_fits_however_noisy(spec: Any, noise: float) -> None:
    small = 0.2 if spec is EE else 1.0
    findings = found(Learned(MADE, spec=spec, noise=small * noise))
    assert findings.kind == "fits", findings.sentence
    assert findings.best is None


def test_differences_of_pose_are_added_up_before_they_are_compared() -> None:
    now = MADE.ee[10].reshape(-1)
    recorded = MADE.ee[11:31].reshape(-1, 16)
    deltas = []
    for before, after in zip(np.vstack([now, recorded[:-1]]), recorded, strict=True):
        row: list[float] = []
        for a, b in zip(before.reshape(2, 8), after.reshape(2, 8), strict=True):
            one, two = (Pose(tuple(p[:3]), tuple(p[3:7])) for p in (a, b))
            step = one.inverse() * two
            row += [*step.position, *step.rotation, b[7]]
        deltas.append(row)
    how = {"each": True, "turned": True, "local": True}
    found = from_pose(np.array(deltas), now, ActionSpace("ee"), **how)
    assert np.allclose(found, recorded, atol=1e-9)


@pytest.mark.parametrize("noise", [0.0, 0.6])
def test_a_policy_that_holds_still_or_knows_nothing_is_accused_of_nothing(noise: float) -> None:
    findings = found(Learned(MADE, lambda chunk, now: np.tile(now, (len(chunk), 1)), noise=noise))
    assert findings.kind == "unclear" and "does not fit" in findings.sentence


def test_what_was_not_recorded_is_said_not_to_be_tried() -> None:
    findings = found(Learned(MADE), episode(measured=False))
    assert any("measured" in text for text in findings.untried)


def test_every_frame_is_asked_in_a_trial_of_its_own() -> None:
    policy = Learned(MADE)
    findings = found(policy)
    assert len(findings.frames) == 8 and findings.frames[0] == 0
    assert max(findings.frames) < FRAMES - CHUNK // 2
    assert policy.trial is not None and policy.trial.instruction == "Pick it up."


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"privileged": True}, "exact state"),
        ({"environment_state": True}, "exact state"),
        ({"action_dim": 16}, "numbers an action"),
        ({"state": "measured"}, "robospa collect --record"),
    ],
)
def test_what_cannot_be_compared_is_one_sentence(change: dict[str, Any], told: str) -> None:
    wide = Learned(MADE, spec=replace(SPEC, **change))
    if "action_dim" in change:
        wide.answer = lambda chunk, now: np.hstack([chunk, chunk[:, :2]])
    with pytest.raises(EpisodeError, match=told):
        check_conventions(wide, episode(measured=False))


# --------- demonstration files: official and ours are read, broken ones are refused in one sentence


@pytest.fixture
def official(tmp_path: Path) -> Path:
    """A file with no more in it than official ones have, where those lie."""
    path = tmp_path / "Pick_Blocks_Size" / "demo_clean" / "data" / "episode3.hdf5"
    write_episode(path, MADE)
    with h5py.File(path, "a") as file:
        del file["joint_action/measured"]
        for name in list(file.attrs):
            del file.attrs[name]
    texts = path.parent.parent / "instructions" / "episode3.json"
    texts.parent.mkdir()
    texts.write_text(json.dumps({"seen": ["Pick the red one.", "Other."], "unseen": ["No."]}))
    return path


def test_our_files_come_back_whole(tmp_path: Path) -> None:
    write_episode(tmp_path / "a.hdf5", MADE)
    back = read_episode(tmp_path / "a.hdf5")
    assert np.array_equal(back.commanded, MADE.commanded)
    assert np.array_equal(back.ee, MADE.ee)
    assert back.measured is not None and np.array_equal(back.measured, MADE.measured)
    assert back.instruction == MADE.instruction and back.about == MADE.about


def test_official_files_have_their_instruction_and_task_beside_them(official: Path) -> None:
    found = read_episode(official)
    assert found.instruction == "Pick the red one."
    assert found.about == {"task": "Pick_Blocks_Size"}
    assert found.measured is None
    assert read_episode(official, "Do it.").instruction == "Do it."


def test_red_stays_red_though_the_jpegs_have_it_as_blue(official: Path) -> None:
    frame = read_episode(official).picture(CameraSpec("left_wrist", 32, 24), 40)
    assert abs(float(frame[..., 0].mean()) - 100) < 3 and frame[-3, -3, 2] < 20
    import io

    from PIL import Image

    red = np.zeros((16, 16, 3), np.uint8)
    red[..., 0] = 255
    stored = np.asarray(Image.open(io.BytesIO(to_jpeg(red))))
    assert stored[8, 8, 2] > 200 > stored[8, 8, 0]  # what a plain reader makes of it


def test_a_policy_is_shown_what_its_spec_asks_for() -> None:
    spec = PolicySpec("x", (CameraSpec("head", 16, 12),), state="measured", history=(-1,))
    seen = MADE.observation(spec, 30)
    assert seen["images"]["head"].shape == (12, 16, 3)
    assert MADE.measured is not None and np.allclose(seen["state"], MADE.measured[30], atol=1e-6)
    assert np.allclose(seen["history"][-1]["state"], MADE.measured[29], atol=1e-6)
    assert (seen["step"], seen["instruction"]) == (30, "Pick it up.")
    assert np.allclose(MADE.observation(spec, 0)["history"][-1]["ee"], MADE.ee[0], atol=1e-6)


def test_a_camera_that_was_not_recorded_is_named() -> None:
    with pytest.raises(EpisodeError, match=r"'front'.*has only head, left_wrist, right_wrist"):
        MADE.observation(PolicySpec("x", (CameraSpec("front"),)), 0)


def _without(at: str) -> Callable[[Any], object]:
    return lambda file: file.pop(at)


def _instead(at: str, value: Any) -> Callable[[Any], object]:
    return lambda file: (file.pop(at), file.create_dataset(at, data=value))


def _in_another_file(file: Any) -> None:
    other = Path(file.filename).with_name("other.hdf5")
    with h5py.File(other, "w") as made:
        made["x"] = np.zeros((FRAMES, 14))
    del file["joint_action/vector"]
    file["joint_action/vector"] = h5py.ExternalLink(str(other), "x")


def _raw_bytes_of(file: Any) -> None:
    del file["observation/head_camera/rgb"]
    file.create_dataset(
        "observation/head_camera/rgb", (FRAMES,), "S10", external=[(__file__, 0, 10 * FRAMES)]
    )


def _unpacks_to(dtype: str, *shape: int) -> Callable[[Any], None]:
    def change(file: Any) -> None:
        del file["observation/head_camera/rgb"]
        chunks = (1, *(min(n, 64) for n in shape))
        file.create_dataset("observation/head_camera/rgb", (FRAMES, *shape), dtype, chunks=chunks)

    return change


BROKEN: dict[str, tuple[Callable[[Any], object], str]] = {
    "no joints": (_without("joint_action/vector"), "has no joint_action/vector"),
    "no poses": (_without("endpose"), "has no endpose/left_endpose"),
    "one frame": (_instead("joint_action/vector", np.zeros((1, 14))), "is \\(1, 14\\)"),
    "odd width": (_instead("joint_action/vector", np.zeros((FRAMES, 13))), "13\\)"),
    "text": (_instead("joint_action/vector", "hello"), "cannot be read"),
    "nan": (_instead("joint_action/vector", np.full((FRAMES, 14), np.nan)), "not finite"),
    "short poses": (_instead("endpose/left_endpose", np.zeros((3, 7))), "endpose/left"),
    "short video": (_instead("observation/head_camera/rgb", np.array([b"x"])), "1 frames"),
    "no frames": (_instead("observation/head_camera/rgb", np.zeros(FRAMES)), "neither JPEGs"),
    "another file": (_in_another_file, "vector lies in another file, which is not read"),
    "raw bytes": (_raw_bytes_of, "head_camera/rgb lies in another file"),
    "huge": (_unpacks_to("u1", 60_000, 60_000, 3), "more than 2147483648"),
    "long": (_unpacks_to("S2000000000"), "more than 2147483648"),
}
"""The last four show other files of this user, or are small and would fill the memory."""


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_file_is_one_sentence(official: Path, what: str) -> None:
    change, told = BROKEN[what]
    with h5py.File(official, "a") as file:
        change(file)
    assert official.stat().st_size < 2**22
    with pytest.raises(EpisodeError, match=told) as error:
        read_episode(official)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["[" * 200_000, '{"seen": 5}', None])
def test_broken_sentences_are_none(official: Path, text: str | None) -> None:
    """The last is a link to something without an end."""
    (path,) = official.parents[1].glob("instructions/*.json")
    path.unlink()
    path.symlink_to("/dev/zero") if text is None else path.write_text(text)
    assert read_episode(official).instruction == ""


@pytest.mark.parametrize("content", [b"", b"not hdf5 at all", b"\x89HDF\r\n\x1a\n" + b"\0" * 80])
def test_what_is_no_hdf5_is_one_sentence(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.hdf5").write_bytes(content)
    with pytest.raises(EpisodeError, match="cannot be read as an HDF5 demonstration"):
        read_episode(tmp_path / "a.hdf5")
    with pytest.raises(EpisodeError, match="there is no file"):
        read_episode(tmp_path / "absent.hdf5")


def test_a_broken_frame_is_one_sentence(official: Path) -> None:
    with h5py.File(official, "a") as file:
        _instead("observation/head_camera/rgb", np.array([b"no jpeg"] * FRAMES))(file)
    with pytest.raises(EpisodeError, match="frame 5 of camera head cannot be read"):
        read_episode(official).observation(SPEC, 5)


def test_without_h5py_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(EpisodeError, match=r"pip install '\S+\[demos\]'"):
        read_episode(tmp_path / "a.hdf5")


# ------- A wrong option of a dialect is named by the replay, and with the right one the policy fits


KNOWS = Learned(MADE)


def go1(seen: Any) -> Any:
    """Trained by RoboTwin's client, which has the wrists swapped."""
    images = {"head": seen["top"], "left_wrist": seen["right"], "right_wrist": seen["left"]}
    if (t := KNOWS.time(images)) is None:
        return np.tile(seen["state"][0], (CHUNK, 1))
    return MADE.commanded[t + 1 : t + 1 + CHUNK] - MADE.commanded[t] + seen["state"][0]


def test_the_replay_names_the_option(tmp_path: Path) -> None:
    write_episode(tmp_path / "demo.hdf5", MADE)
    words = ("--trials", "0", "--load-seconds", "0", "--demo", tmp_path / "demo.hdf5")
    with standins.Go1(go1) as url:
        wrong, right = (robospa("check", url + more, *words) for more in ("", "?wrists=swapped"))
    said = " ".join(wrong.out.split())
    assert wrong.code == 1 and "wrist images are swapped" in said and "option wrists" in said, said
    assert right.code == 0 and "It fits the demonstration" in right.out, right.out


# ------- and through the servers of each preset, whose wires differ

ORDER = [0, 1, 2, 3, 4, 5, 12, 6, 7, 8, 9, 10, 11, 13]
CAMS = ("cam_high", "cam_left_wrist", "cam_right_wrist")
VLLM = [f"observation.images.{name}_0_rgb" for name in ("base", "left_wrist", "right_wrist")]
PRESETS: dict[str, tuple[Any, Callable[[Any], Any], Callable[[Any], Any]]] = {
    "starvla": (
        {"env": "starvla_policy_server"},
        lambda seen: (seen["examples"][0]["image"], seen["examples"][0]["state"][0][ORDER]),
        lambda chunk: {"data": {"actions": chunk[None][..., np.argsort(ORDER)]}},
    ),
    "vllm": (
        {"image_resolution": [1, 1]},
        lambda seen: ([seen["images"][name] for name in VLLM], seen["state"]),
        lambda chunk: np.pad(chunk, ((0, 0), (0, 18))),
    ),
    "lingbot": (
        {},
        lambda seen: ([seen[f"observation.images.{n}"] for n in CAMS], seen["observation.state"]),
        lambda chunk: {"action": chunk},
    ),
    "gr00t": (
        {},
        lambda seen: (
            [seen["video"][name][0, 0] for name in CAMS],
            np.concatenate(list(seen["state"].values()), axis=-1).ravel(),
        ),
        lambda chunk: chunk,
    ),
    "oft": (
        {},
        lambda seen: ([seen["full_image"], *seen["wrists"]], seen["state"]),
        lambda chunk: chunk,
    ),
}
"""What a server greets with; the pictures and our joints in a message; the answer of a chunk."""
WRONG: dict[tuple[str, ...], tuple[Change, float]] = {
    ("grippers of the state 0..100", "gripper 0..100"): (ANSWERS["gripper 0..100"], 100.0),
    ("grippers of the state 0..0.1", "gripper 0..0.1"): (ANSWERS["gripper 0..0.1"], 0.1),
    ("arms swapped",): (SWAP, 1.0),
    ("delta from the start",): (ANSWERS["delta from the start"], 1.0),
}
"""What a policy makes of its chunk, and its number for an open gripper in the state: it holds still
where the grippers that it reads are not those of the frame."""


@pytest.mark.parametrize("names", WRONG)
@pytest.mark.parametrize("preset", PRESETS)
def test_wrong_conventions_are_named_through_every_preset(
    preset: str, names: tuple[str, ...]
) -> None:
    greeting, read, write = PRESETS[preset]
    change, scale = WRONG[names]

    def model(seen: Any) -> Any:
        if "reset" in (seen.get("endpoint"), *seen):
            return {"action": None}
        pictures, joints = read(seen)
        now = joints / np.where(np.arange(14) % 7 == 6, scale, 1.0)
        t = KNOWS.time(dict(zip(OFFSETS, pictures, strict=True)))
        chunk = np.tile(now, (CHUNK, 1))
        if t is not None and np.abs(now - MADE.commanded[t])[[6, 13]].max() < 0.2:
            chunk = MADE.commanded[t + 1 : t + 1 + CHUNK]
        return write(change(chunk, now))

    server = {"gr00t": standins.Gr00t, "oft": standins.Oft}.get(preset, standins.Family)(model)
    server.scheme, server.metadata = {"oft": "oft+http"}.get(preset, preset), greeting
    if preset == "gr00t":
        server.config["video"]["modality_keys"] = list(CAMS)
    with standins.talking(server, "?joints=state[]" if preset == "starvla" else "") as policy:
        findings = check_conventions(policy, MADE, 3)
    assert findings.best is not None and findings.best.names == names


# ------------------- what `robospa collect --record` writes is a demonstration that can be replayed


class ByHeart:
    """Knows the episode; `inverted` has 1 for a closed gripper."""

    spec = PolicySpec("by-heart")

    def __init__(self, made: Episode, inverted: bool) -> None:
        self.made, self.inverted = made, inverted

    def reset(self, trial: TrialInfo) -> None:
        assert trial.task == "Pick_Blocks_Size" and trial.instruction

    def infer(self, observation: Mapping[str, Any]) -> Any:
        t = observation["step"]
        chunk = self.made.commanded[t + 1 : t + 51].astype(np.float32)
        if self.inverted:
            chunk[:, [6, 13]] = 1 - chunk[:, [6, 13]]
        return chunk


@pytest.mark.skipif("oracle" not in names(POLICIES), reason="robospa is not installed")
@pytest.mark.sim
def test_a_recorded_trial_is_a_demonstration(tmp_path: Path) -> None:
    file = tmp_path / "demo.hdf5"
    words = ("collect", "--record", "Pick_Blocks_Size", "--seed", 100_000, "--out", file)
    done = robospa(*words)
    assert done.code == 0 and "success" in done.out
    made = read_episode(file)
    assert made.commanded.shape == (len(made), 14) and len(made) > 50
    arms = [c for c in range(14) if c not in (6, 13)]
    assert np.abs(np.diff(made.commanded[:, arms], axis=0)).max() < 0.18  # 3 rad/s for 60 ms
    assert made.measured is not None
    assert np.abs(made.measured - made.commanded)[:, arms].max() < 0.1
    assert set(made.frames) == {camera.name for camera in DEFAULT_CAMERAS}
    pictures = [made.picture(camera, len(made) // 2) for camera in DEFAULT_CAMERAS]
    assert all(picture.shape == (240, 320, 3) and picture.std() > 5 for picture in pictures)
    assert check_conventions(ByHeart(made, False), made, 3).kind == "fits"
    wrong = check_conventions(ByHeart(made, True), made, 4)
    assert wrong.best is not None and wrong.best.names == ("gripper inverted",)
    done = robospa(*words)  # nothing is overwritten
    assert done.code == 1 and "exists already" in done.err
