#!/usr/bin/env bash
# From nothing to one row: demonstrations, LeRobot's fine-tuning, evaluation, report.
#
#   bash docs/examples/first_row.sh smolvla|pi05|xvla|act TASK FOLDER
#
# Run on one machine with a GPU. What exists already is not made again, so the same command goes on.
# LEROBOT is the folder of LeRobot's environment, BASE other weights to begin with; EPISODES (a level),
# STEPS, BATCH, TRIALS, DEVICE and VIDEO may be smaller for a try. Further words go to lerobot-train.

set -euo pipefail

model=$1 task=$2 out=$(realpath -m "$3")
shift 3
robospa=${ROBOSPA:-robospa} lerobot=${LEROBOT:-lerobot-env} device=${DEVICE:-cuda}
checkpoint=$out/train/checkpoints/last/pretrained_model

renamed() { # renamed NAME NAME NAME: the cameras head, left_wrist and right_wrist in the model
    printf -- '--rename_map={"observation.images.head": "observation.images.%s", "observation.images.left_wrist": "observation.images.%s", "observation.images.right_wrist": "observation.images.%s"}' "$@"
}

case "$model" in
smolvla) words=(--policy.path="${BASE:-lerobot/smolvla_base}" "$(renamed camera1 camera2 camera3)") ;;
xvla) words=(--policy.path="${BASE:-lerobot/xvla-base}" --policy.action_mode=auto --policy.dtype=bfloat16
    "$(renamed image image2 image3)") ;;
pi05) words=(--policy.type=pi05 --policy.pretrained_path="${BASE:-lerobot/pi05_base}" --policy.dtype=bfloat16
    --policy.gradient_checkpointing=true --policy.scheduler_decay_steps="${STEPS:-20000}") ;;
act) words=(--policy.type=act) ;;
*) echo "first_row: $model is none of smolvla, pi05, xvla and act" >&2; exit 2 ;;
esac

[ -f "$out/data/robospa.json" ] || "$robospa" collect "$out/data" --tasks "$task" --levels 1-5 \
    --episodes "${EPISODES:-50}" --format lerobot-v3 --images h264
[ -d "$checkpoint" ] || "$lerobot/bin/lerobot-train" --dataset.repo_id="robospa/$task" \
    --dataset.root="$out/data" --policy.push_to_hub=false --policy.device="$device" \
    --batch_size="${BATCH:-16}" --steps="${STEPS:-20000}" --output_dir="$out/train" "${words[@]}" "$@"

"$lerobot/bin/robospa" serve lerobot --option "path=$checkpoint" --option "device=$device" --port "${PORT:-8000}" &
server=$!
trap 'kill "$server"' EXIT
"$robospa" eval "ws://127.0.0.1:${PORT:-8000}" --tasks "$task" --trials "${TRIALS:-100}" --wait 600 \
    --video "${VIDEO:-failures}" --auto-resume --out "$out/run"
"$robospa" report "$out/run"
