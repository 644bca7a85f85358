#!/bin/bash
#SBATCH --job-name=robospa
#SBATCH --nodes=2
#SBATCH --ntasks-per-node=1
#SBATCH --cpus-per-task=40
#SBATCH --gpus-per-node=4
#SBATCH --time=04:00:00
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --signal=B:TERM@120
#
# One evaluation on a few Slurm nodes: a policy server on every GPU, simulators on the cores, Ray
# between them. Two minutes before its time is up, or when it is pre-empted, the job stops the run in
# good order; `sbatch` the same script again, or let Slurm requeue it, and the run goes on.
#
#   RUN=runs/mine SERVE="openpi --options pi0.json" EVAL="--tasks all" sbatch docs/examples/slurm_ray.sh
#
# All nodes need the same robospa[sim,ray]: here the same .venv on a shared disk.

set -euo pipefail

RUN=${RUN:-runs/slurm}                           # on a disk that survives the job
SERVE=${SERVE:?such as SERVE="openpi --options pi0.json"}
EVAL=${EVAL:-"--tasks all"}                      # further words for robospa eval
ROBOSPA=${ROBOSPA:-.venv/bin/robospa}            # where the simulator is
SERVE_ROBOSPA=${SERVE_ROBOSPA:-$ROBOSPA}         # robospa in the model's own environment
RAY=${RAY:-$(dirname "$ROBOSPA")/ray}
GPUS=${GPUS:-${SLURM_GPUS_ON_NODE:-0}}           # a server each; 0: one server without GPU
CPUS=${SLURM_CPUS_PER_TASK:-$(nproc)}
SIM_CPUS=${SIM_CPUS:-$((CPUS - 2 * (GPUS > 0 ? GPUS : 1)))} # two cores stay for each server
PORT=${PORT:-6379}
FIRST_PORT=${FIRST_PORT:-8000}

secret() { head -c 24 /dev/urandom | base64 | tr -d '/+='; }
export ROBOSPA_TOKEN=${ROBOSPA_TOKEN:-$(secret)} # servers and Ray listen to this job only
export RAY_AUTH_MODE=token RAY_AUTH_TOKEN=${RAY_AUTH_TOKEN:-$(secret)}
export RAY_USAGE_STATS_ENABLED=0

mapfile -t nodes < <(scontrol show hostnames "$SLURM_JOB_NODELIST")
head=${nodes[0]}
started=()

on() { # on NODE COMMAND...: in the background, all cores of the node at hand
    local node=$1
    shift
    srun --overlap --nodes=1 --ntasks=1 --cpus-per-task="$CPUS" --nodelist="$node" "$@" &
    started+=($!)
}

finish() {
    [ ${#started[@]} -eq 0 ] || kill -TERM "${started[@]}" 2>/dev/null || true
    wait
}
trap finish EXIT

# Policy servers: the evaluation waits for them (--wait), however long they load.
servers=()
for n in "${!nodes[@]}"; do
    for ((gpu = 0; gpu < (GPUS > 0 ? GPUS : 1); gpu++)); do
        port=$((FIRST_PORT + 100 * n + gpu))
        # shellcheck disable=SC2086
        on "${nodes[$n]}" env CUDA_VISIBLE_DEVICES="$([ "$GPUS" -eq 0 ] || echo "$gpu")" \
            "$SERVE_ROBOSPA" serve $SERVE --host 0.0.0.0 --port "$port"
        servers+=("ws://${nodes[$n]}:$port")
    done
done

# Ray: its head on the first node, then the others. GPUs are the servers'; Ray is told of none.
limits=(--num-cpus="$SIM_CPUS" --num-gpus=0 --object-store-memory=200000000 --disable-usage-stats --block)
on "$head" "$RAY" start --head --port="$PORT" --include-dashboard=false "${limits[@]}"
until (exec 3<>"/dev/tcp/$head/$PORT") 2>/dev/null; do sleep 1; done
for node in "${nodes[@]:1}"; do
    on "$node" "$RAY" start --address="$head:$PORT" "${limits[@]}"
done

# The run. Nodes that come up later are used from then on; a node that is lost costs its trials in
# flight, which run elsewhere.
words=("${servers[0]}")
for server in "${servers[@]:1}"; do words+=(--policy "$server"); done
[ ! -e "$RUN/run.json" ] || words+=(--resume)
# shellcheck disable=SC2086
"$ROBOSPA" eval "${words[@]}" $EVAL --out "$RUN" --wait 1800 --executor ray --address "$head:$PORT" &
run=$!
trap 'kill -TERM "$run" 2>/dev/null || true' TERM INT # robospa stops in good order and can resume
status=0
wait "$run" || status=$?
while kill -0 "$run" 2>/dev/null; do wait "$run" || status=$?; done
if [ "$status" -eq 130 ] && [ -n "${SLURM_JOB_ID:-}" ]; then
    scontrol requeue "$SLURM_JOB_ID" || true # time is up or pre-empted: once more, from here
fi
exit "$status"
