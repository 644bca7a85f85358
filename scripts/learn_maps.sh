#!/usr/bin/env bash
# The policy from pictures and words that stands on the leaderboard, from nothing to its bundle.
#
#   bash scripts/learn_maps.sh
#
# 150 demonstrations of each variant of GAC, training, 2,000 trials with held-out sentences, a bundle.
# It needs PyTorch: `pip install torch` in .venv, or ROBOSPA_LEARN_PYTHON, the path of a Python that
# has it beside robospa's packages. Two trainings on one kind of CPU with one version of PyTorch give
# the same weights to the bit. Every step goes on where it was interrupted, and does nothing once it
# is done; what it makes lies in runs/learn-maps.

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

out=runs/learn-maps
bin=.venv/bin
python=${ROBOSPA_LEARN_PYTHON:-$bin/python}
export PYTHONPATH=$PWD

say() { printf '\nlearn: %s\n' "$*"; }

"$python" -c "import torch" 2>/dev/null || {
    echo "learn: $python has no PyTorch: pip install torch there, or set ROBOSPA_LEARN_PYTHON" >&2
    exit 1
}
mkdir -p "$out"

say "1 of 4: 3,000 demonstrations (0.5 s of one core each)"
$bin/robospa collect --tasks GAC --levels 1-5 --episodes 150 --frames keyframes --cameras head \
    --images png --keep-episodes --out "$out/data" --resume

say "2 of 4: training (some 30 minutes of one core)"
resume=()
[ ! -f "$out/policy/policy.json" ] || resume=(--resume)
"$python" -m robospa learn train maps "$out/data" --out "$out/policy" "${resume[@]}" \
    --option choices=5000 --option threads=1

say "3 of 4: 2,000 trials (0.5 s of one core each), by two servers of one thread"
servers=()
trap 'kill "${servers[@]}" 2>/dev/null || true' EXIT
urls=()
for n in 1 2; do
    "$python" -m robospa serve learned "$out/policy" --port 0 >"$out/server$n.log" 2>&1 &
    servers+=($!)
done
for n in 1 2; do
    url=
    for _ in $(seq 600); do
        url=$(sed -n 's/^serving .* at \(ws:[^ ]*\).*/\1/p' "$out/server$n.log")
        [ -z "$url" ] || break
        kill -0 "${servers[n - 1]}" 2>/dev/null || {
            cat "$out/server$n.log" >&2
            exit 1
        }
        sleep 0.5
    done
    urls+=("$url")
done
resume=()
[ ! -f "$out/run/run.json" ] || resume=(--resume)
$bin/robospa eval "${urls[0]}" --policy "${urls[1]}" --tasks GAC --out "$out/run" --wait 120 \
    "${resume[@]}"
$bin/robospa report "$out/run"

say "4 of 4: the bundle"
hash=$(cd "$out/policy" && sha256sum chooser.pt network.pt | sha256sum | cut -d' ' -f1)
parameters=$("$python" - "$out/policy" <<'PYTHON'
import pathlib, sys, torch

files = [pathlib.Path(sys.argv[1], name) for name in ("network.pt", "chooser.pt")]
weights = [torch.load(file, map_location="cpu", weights_only=True) for file in files]
print(sum(tensor.numel() for one in weights for tensor in one.values()))
PYTHON
)
sed "s/SHA256/$hash/; s/PARAMETERS/$parameters/" baselines/learned/maps/model.toml >"$out/model.toml"
$bin/robospa submit pack "$out/run" --model "$out/model.toml" -o "$out/bundle.zip" --force
