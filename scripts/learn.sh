#!/usr/bin/env bash
# The learned reference that stands on the leaderboard, from its weights to its bundle.
#
#   bash scripts/learn.sh [CATEGORY,...]       # default: the five spatial ones
#
# The trials with held-out sentences, and a bundle. The weights are those in baselines/learned/weights;
# with ROBOSPA_LEARN=1 they are first trained anew (a night of two cores). It needs PyTorch: `pip
# install torch --index-url https://download.pytorch.org/whl/cpu` in .venv, or ROBOSPA_LEARN_PYTHON,
# the path of a Python that has it beside robospa's packages. Every step goes on where it was interrupted; what it makes lies in runs/learned-row.

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

tasks=${1:-spatial}
out=runs/learned-row
bin=.venv/bin
python=${ROBOSPA_LEARN_PYTHON:-$bin/python}
weights=baselines/learned/weights
export PYTHONPATH=$PWD

say() { printf '\nlearn: %s\n' "$*"; }

"$python" -c "import torch" 2>/dev/null || {
    echo "learn: $python has no PyTorch: pip install torch --index-url https://download.pytorch.org/whl/cpu there, or set ROBOSPA_LEARN_PYTHON" >&2
    exit 1
}
mkdir -p "$out"

if [ "${ROBOSPA_LEARN:-0}" = 1 ]; then
    say "training"
    "$python" -m robospa.harness.cli.main learn "$out/weights"
    weights=$out/weights
fi

say "trials of $tasks"
"$python" -m robospa.harness.cli.main serve learned "$weights" --port 0 >"$out/server.log" 2>&1 &
server=$!
trap 'kill "$server" 2>/dev/null || true' EXIT
url=
for _ in $(seq 600); do
    url=$(sed -n 's/^serving .* at \(ws:[^ ]*\).*/\1/p' "$out/server.log")
    [ -z "$url" ] || break
    kill -0 "$server" 2>/dev/null || {
        cat "$out/server.log" >&2
        exit 1
    }
    sleep 0.5
done
[ -n "$url" ] || {
    echo "learn: the server did not start within 5 minutes, see $out/server.log" >&2
    exit 1
}
$bin/robospa eval "$url" --tasks "$tasks" --out "$out/run" --auto-resume --wait 120
$bin/robospa report "$out/run"

say "the bundle"
hash=$(cd "$weights" && sha256sum ./*.npz | sha256sum | cut -d' ' -f1)
sed -E "s/^sha256 = \"[0-9a-f]*\"/sha256 = \"$hash\"/" \
    leaderboard/submissions/learned-reference/model.toml >"$out/model.toml"
$bin/robospa submit pack "$out/run" --model "$out/model.toml" -o "$out/bundle.zip" --force
