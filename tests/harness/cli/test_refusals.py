"""What a user who got something wrong is told: one sentence that says what to do, and nothing is
written."""

import socket
from pathlib import Path

import pytest
from command_line import eval_words, robospa
from run_fakes import FakePolicy

from robospa import extras
from robospa.protocol.server import ServerThread

REFUSED = [
    ("compare", "compare needs two sides"),
    ("compare nowhere RDT", "there is no folder nowhere, and no published model is called"),
    ("compare pi06 RDT", "did you mean pi0.5? there are RDT, GO-1, pi0.5, X-VLA"),
    (
        "paper --out p --format pdf",
        "no format is called 'pdf'; there are md, tex, html, csv and all",
    ),
    ("paper --out p --table mian", "no table is called 'mian'; there are main,"),
    ("paper --out p --mark bold", "no mark is called 'bold'; there are tied, highest, none"),
    ("paper --out p --run nowhere", "nowhere is not a run"),
    ("report nowhere --lint", "nowhere is not a run"),
    ("report a --ci wald", "no interval is called 'wald'; there are wilson, exact"),
    ("report a b", "belongs to none of them; say where with --out"),
    ("report a", "a is not a run: it has no run.json"),
    ("report a --failures", "a is not a run: it has no run.json"),
    ("report a b --audit", "are of one run"),
    ("view .", "is not a run"),
    ("collect a --out b", "two folders"),
    ("submit verify .", "is a folder: a bundle is a .zip"),
    ("submit no.zip", "no.zip"),
    ("official assets", "`robospa official assets DIR --add`"),
    ("check ws://127.0.0.1:9 --demo no.hdf5", "cannot be read as an HDF5 demonstration"),
    ("eval localhost:8000 --out run", "of a server write ws://localhost:8000"),
    ("eval http://localhost:8000 --out run", "(ws:// for one of robospa serve)\n"),
    ("eval mine.py:Mine --out run", "is a file: write mine:Mine, in its folder"),
    ("eval ./mine.py --out run", "is a file: write mine:MyPolicy, in its folder"),
    ("eval ws://127.0.0.1:9 --client no.toml --out run", "--client no.toml: No such file"),
    ("eval hold --policy-map no.json --out run", "give the policy or --policy-map FILE, not both"),
    ("eval --policy-map no.json --out run", "no.json cannot be read: No such file"),
    ("serve hold --options no.json", "robospa: no.json: No such file"),
    ("serve hold --option size=1", "(see robospa serve hold --show-options)"),
    ("report a --trials", "a is not a run: it has no run.json"),
    ("eval hold --latency 0,100", "--out"),
    ("eval hold --out run\udcff", r"'run\udcff' is not UTF-8"),
]
REFUSED += [
    (f"eval hold --out run --latency={given}", "two or more growing numbers")
    for given in ("0", "200,100", "0,x", "-5,10", "0,0")
]
REFUSED += [
    (f"eval hold --tasks Pick_Blocks_Size --action-rate 25 --out run --latency {given}", said)
    for given, said in (("0,70000", "from 0 to 60000 ms"), ("0,nan", "is no latency"))
]
REFUSED += [
    (" ".join(eval_words("run", *words.split())), said)
    for words, said in [
        ("ws://127.0.0.1:9", "127.0.0.1:9"),
        ("nobody", "no policy 'nobody'"),
        ("run_fakes:picky", "drives only-me, not aloha-agilex"),
        ("hold --levels 6", "no level 6"),
        ("hold --tasks Pick_Block_Size", "did you mean Pick_Blocks_Size"),
        ("hold --seeds nowhere.json", "neither a file nor a list"),
        ("hold --config no.toml", "no.toml: it cannot be read"),
        ("hold --world run_fakes:Broken", "robospa check"),
    ]
]
MISTYPED = [
    ("check localhost:8000", "did you mean ws://localhost:8000?"),
    ("compare a b --metric best", "'--metric': 'best' is not one of"),
    ("submit .", "--model"),
    ("check ws://127.0.0.1:9 --timeout -5", "-5 is not from 0.001 to 604800"),
    ("check --demo no.hdf5", "go with a server's URL"),
    ("seeds Pick_Blocks_Size --levels 1 --count 101", "a shipped list of 100 seeds"),
    ("tasks Pick_Block_Size", "did you mean Pick_Blocks_Size"),
    ("tasks Pick_Blocks_Size --level 6", "has levels"),
    ("tasks Pick_Blocks_Size --seed -1", "is not from 0 to"),
    ("tasks Pick_Blocks_Size --split test", "there are train, heldout, indirect"),
    ("tasks Pick_Blocks_Size --size 640", "is not WIDTHxHEIGHT"),
    ("tasks Pick_Blocks_Size --size 640x9999", "is not between"),
    ("tasks Pick_Blocks_Size --camera rear", "no camera"),
    ("tasks Pick_Blocks_Size --world sapien", "no pictures are made of the world"),
    ("tasks Pick_Blocks_Size --world official?speed=2", "--world official?speed=2"),
    ("tasks Pick_Blocks_Size --world official --json", "leave out --json and --view"),
    ("tasks Pick_Blocks_Size,Pick_Nothing --gallery --out sheet.jpg", "Pick_Nothing"),
]


@pytest.mark.parametrize(
    ("code", "line", "said"),
    [*((1, *row) for row in REFUSED), *((2, *row) for row in MISTYPED)],
)
def test_every_refusal_is_one_sentence_and_writes_nothing(
    code: int, line: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("no.zip", "no.hdf5"):
        (tmp_path / name).write_text("no")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROBOSPA_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("ROBOSPA_ASSETS", raising=False)
    done = robospa(*line.split())
    assert (done.code, done.out) == (code, "") and said in done.err
    assert done.err.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"no.zip", "no.hdf5"}


WRONG_MODULES = [
    ("class Mine", "SyntaxError: expected ':'"),
    ("from . import weights", "attempted relative import"),
    ("{}['weights']", "KeyError: 'weights'"),
    ("import robospa", "has no attribute 'Mine'"),
    ("class Mine:\n    def __init__(self, weights): ...", "missing 1 required positional argument"),
    ("class Mine: ...", "Mine.spec is no PolicySpec but NoneType"),
    (
        "import robospa\nclass Mine:\n    spec = robospa.PolicySpec('mine')\n"
        "    def reset(self, trial): ...",
        "Mine has no method infer(observation), which every policy needs",
    ),
    (
        "import robospa\nclass Mine:\n    spec = robospa.PolicySpec('mine', state='joints')\n"
        "    def reset(self, trial): ...\n    def infer(self, observation): ...",
        "Mine.spec: 'state' must be one of commanded, measured, none, not 'joints'",
    ),
]


@pytest.mark.parametrize("number", range(len(WRONG_MODULES)))
def test_a_policy_that_cannot_be_made_is_refused_by_both_commands(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, said = WRONG_MODULES[number]
    (tmp_path / f"wrong_module_{number}.py").write_text(text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    name = f"wrong_module_{number}:Mine"
    words = eval_words("run", name)
    for done in (robospa(*words), robospa("serve", name, "--port", "0")):
        assert (done.code, done.out) == (1, "") and said in done.err
        assert done.err.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_a_forgotten_token(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROBOSPA_TOKEN", raising=False)
    with ServerThread(policy_factory=FakePolicy, token="a secret of theirs") as server:
        done = robospa("eval", server.url, "--tasks", "Pick_Blocks_Size", "--out", tmp_path / "run")
    assert "refused the token: missing or wrong token; give the server's token with" in done.err


def test_a_port_that_is_taken() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = robospa("serve", "hold", "--port", port)
    said = f"robospa: port {port} of 127.0.0.1 is in use: choose another --port"
    assert done.code == 1 and done.err.startswith(said)


def test_a_collection_names_its_extra_before_it_makes_anything(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(module: str) -> None:
        raise ModuleNotFoundError(f"No module named {module!r}", name=module)

    monkeypatch.setattr(extras, "import_module", missing)
    out = tmp_path / "data"
    done = robospa("collect", "--tasks", "Pick_Blocks_Size", "--episodes", "1", "--out", out)
    assert done.code == 1 and "pyarrow is not installed; install it with" in done.err
    assert done.err.endswith("[demos]'\n") and not out.exists()
