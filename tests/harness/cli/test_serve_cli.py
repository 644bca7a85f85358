"""`robospa serve`: options are typed, checked and listed; models are shared, others are not."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from checkouts import write_checkout
from command_line import robospa
from fake_runs import KNOWN, make_run, outcomes, write

from robospa.clients import connect
from robospa.harness.cli.main import COMMANDS, command_of
from robospa.protocol.options import option
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.protocol.server import ServerThread

ROOT = Path(__file__).resolve().parents[3]
TRIAL = TrialInfo("t", "aloha-agilex", "lift it")
SEEN = {"step": 0, "instruction": "lift it", "images": {}, "state": np.zeros(14, np.float32)}


@dataclass(frozen=True)
class Options:
    """Of the model below."""

    path: str = option("", "where it is")
    rows: int = option(2, "actions in a chunk")

    def __post_init__(self) -> None:
        if not self.path:
            raise ValueError("option path is needed")


class Model:
    """A model that all connections share."""

    made = 0

    def __init__(self, options: Options) -> None:
        Model.made += 1
        self.options = options
        self.spec = PolicySpec("model", cameras=(), horizon=9)

    def reset(self, trial: TrialInfo) -> None:
        """Nothing to do."""

    def infer(self, observation: Any) -> Any:
        return self.infer_batch([observation], [0])[0]

    def infer_batch(self, observations: Sequence[Any], sessions: Sequence[int]) -> list[Any]:
        return [np.zeros((self.options.rows, 14), np.float32) for _ in observations]


def create(options: Options) -> Model:
    return Model(options)


def untyped(number: str = "1") -> Model:
    return Model(Options("x", int(number)))


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the command hands to the server, which is not started."""
    found: dict[str, Any] = {}
    monkeypatch.setattr("robospa.protocol.server.serve", lambda **given: found.update(given))
    return found


def run(*words: str) -> None:
    assert robospa("serve", *words).code == 0


def fails(*words: str) -> str:
    done = robospa("serve", *words)
    assert done.code
    return done.err


def test_options_are_typed_and_the_model_is_made_once(served: dict[str, Any]) -> None:
    run(f"{__name__}:create", "--option", "path=here", "--option", "rows=5")
    assert served["policy"].options == Options("here", 5)
    assert "policy_factory" not in served


def test_clients_are_told_the_options(served: dict[str, Any]) -> None:
    run(f"{__name__}:create", "--option", "path=here", "--option", "rows=2")
    name = served["options"].name
    assert name.startswith("robospa ") and name.endswith(f"{__name__}:create path=here")
    with (
        ServerThread(served["policy"], options=served["options"]) as server,
        connect(server.url) as policy,
    ):
        assert policy.hello["server"] == name


def test_options_come_from_a_file_and_the_command_line_wins(
    served: dict[str, Any], tmp_path: Path
) -> None:
    file = tmp_path / "options.json"
    file.write_text(json.dumps({"path": "there", "rows": 3}))
    run(f"{__name__}:create", "--options", str(file), "--option", "rows=4")
    assert served["policy"].options == Options("there", 4)


def test_a_plain_function_makes_one_policy_per_connection(served: dict[str, Any]) -> None:
    run(f"{__name__}:untyped", "--arg", "number=3")
    made = Model.made
    assert served["policy_factory"]().options.rows == 3
    assert Model.made == made + 1


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["create"], "option path is needed"),
        (["create", "--option", "pth=x"], "no option 'pth'; did you mean path?"),
        (["create", "--option", "path=x", "--option", "rows=many"], "is not a whole number"),
        (["create", "--option", "path"], "not NAME=VALUE"),
        (["create", "--option", "path=a", "--option", "path=b"], "given twice"),
        (["untyped", "--option", "rows=1"], "unexpected keyword argument 'rows'"),
        (["untyped", "--key", "mine.pem"], "nothing is encrypted"),
        (["untyped", "--certificate", "/none.pem"], "/none.pem cannot be used: No such file"),
    ],
)
def test_options_that_cannot_be_are_named(words: list[str], says: str) -> None:
    assert says in fails(f"{__name__}:{words[0]}", *words[1:])


def test_a_broken_options_file_is_named(tmp_path: Path) -> None:
    file = tmp_path / "options.json"
    file.write_text("{")
    assert "is no JSON" in fails(f"{__name__}:create", "--options", str(file))
    file.write_text("[]")
    assert "one JSON object" in fails(f"{__name__}:create", "--options", str(file))


def test_options_are_listed() -> None:
    assert robospa("serve", f"{__name__}:create", "--show-options").out.splitlines() == [
        "path  where it is [text; default needed]",
        "rows  actions in a chunk [whole number; default 2]",
    ]


def test_the_example_with_options_is_served_as_printed(
    served: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = (ROOT / "docs" / "examples" / "my_model.py").read_text()
    page = (ROOT / "docs" / "adding-a-policy.md").read_text()
    assert source.split("\n\n\n", 1)[1].strip() in page
    np.savez(tmp_path / "weights.npz", mean=np.linspace(0, 1, 14))
    monkeypatch.syspath_prepend(ROOT / "docs" / "examples")
    run("my_model:create", f"--option=checkpoint={tmp_path / 'weights.npz'}", "--option=rows=4")
    chunks = []
    with ServerThread(served["policy"]) as server, connect(server.url) as policy:
        for seed in (1, 1, 2):
            policy.reset(replace(TRIAL, policy_seed=seed))
            image = np.zeros((240, 320, 3), np.uint8)
            chunks.append(policy.infer({**SEEN, "images": {"head": image}}))
    assert chunks[0].shape == (4, 14)
    assert np.array_equal(chunks[0], chunks[1])
    assert not np.array_equal(chunks[0], chunks[2])


# ----------------------- `robospa view`: says where to look, ends when told, refuses what is no run


def test_it_shows_a_run_for_a_while(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run", KNOWN).folder
    done = robospa("view", folder, "--minutes", "0.0001")
    assert done.code == 0 and "http://127.0.0.1:" in done.out


# ---------- `--json`: every command that reports has it, and standard output is then one JSON value


TASK = "Pick_Blocks_Size"
SILENT = {
    "demo": "shows how the others look",
    "serve": "runs until it is stopped",
    "view": "opens a browser",
    "learn": "prints the folder",
    "submit template": "prints a TOML file",
}
"""Commands that report nothing to a program, and why."""
HERE = {
    "report": "report {run}",
    "compare": "compare {run} {other}",
    "paper": "paper --out {tmp}/paper --table basic",
    "tasks": "tasks Pick_Blocks_Size",
    "official instructions": "official instructions {tmp}/checkout --levels 2 --tasks {task}",
    "leaderboard build": "leaderboard build --submissions {tmp}/none --out {tmp}/site",
}


def commands() -> Iterator[tuple[str, Any]]:
    """Every command with its name, such as `submit verify`."""
    for name in COMMANDS:
        found = command_of(name)
        app = found if isinstance(found, typer.Typer) else typer.Typer()
        if app is not found:
            app.command(name)(found)
        command: Any = typer.main.get_command(app)
        parts = getattr(command, "commands", {})
        if not parts or command.invoke_without_command:
            yield name, command
        yield from ((f"{name} {part}", one) for part, one in parts.items())


def test_every_command_that_reports_has_json() -> None:
    having = {name for name, one in commands() if any("--json" in p.opts for p in one.params)}
    assert having == {name for name, _ in commands()} - set(SILENT)


@pytest.mark.usefixtures("no_figures")
@pytest.mark.parametrize("line", HERE.values(), ids=HERE)
def test_standard_output_is_one_json_value(line: str, tmp_path: Path) -> None:
    for name, found in (("one", [1, 1, 0]), ("two", [1, 0, 0])):
        write(tmp_path / name, outcomes("Pick_Blocks_Size", 1, found))
    write_checkout(tmp_path / "checkout")
    words = line.format(
        run=tmp_path / "one", other=tmp_path / "two", tmp=tmp_path, task=TASK
    ).split()
    done = robospa(*words, "--json")
    assert json.loads(done.out) and "Traceback" not in done.err
