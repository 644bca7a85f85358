#!/usr/bin/env bash
# The environment of the tests with torch, as its lock file says.
#
#   bash scripts/models.sh    .venv-models: LeRobot and tiny models
#
# The Python is looked for on PATH and among pyenv's versions; MODELS_PYTHON names another. TORCH_INDEX
# may name an index of CPU builds of torch; without it, or if that cannot be reached, torch comes from the index that pip
# is configured for, on Linux with its CUDA libraries (about 3 GB). Run again, it changes nothing.

set -euo pipefail

venv=.venv-models
lock=requirements-models.lock
torch_index=${TORCH_INDEX:-}

say() { printf 'models: %s\n' "$*"; }

fail() {
    printf 'models: %s\n' "$*" >&2
    exit 1
}

# A shim of pyenv answers with an error if its version is not switched on: it is run, not only found.
runs() {
    "$1" -c "import ensurepip, sys, venv; sys.exit(sys.version_info[:2] != (3, 12))" 2>/dev/null
}

pyenv_pythons() {
    local root=${PYENV_ROOT:-$(pyenv root 2>/dev/null || printf '%s' "${HOME:-}/.pyenv")}
    printf '%s\n' "$root"/versions/3.12*/bin/python3.12 | sort -rV # the newest first
}

find_python() {
    local candidate
    while read -r candidate; do
        if [ -n "$candidate" ] && runs "$candidate"; then
            command -v "$candidate"
            return 0
        fi
    done < <(printf '%s\n' "${MODELS_PYTHON:-}" python3.12 && pyenv_pythons &&
        printf '%s\n' python3 .venv/bin/python)
    fail "$venv needs Python 3.12, and none that runs is on PATH or among pyenv's versions:" \
        "install one (such as with \`pyenv install 3.12\`) or set MODELS_PYTHON to its path."
}

pip_install() { "$venv/bin/python" -m pip install -q --disable-pip-version-check "$@"; }

make_environment() {
    local now python torch
    cd "$(dirname "${BASH_SOURCE[0]}")/.."
    now="$(cat "$lock" | sha256sum | cut -d' ' -f1) with robospa"
    [ "$(cat "$venv/.robospa-models" 2>/dev/null || true)" != "$now" ] || exit 0
    python=$(find_python)
    say "making $venv with $python"
    "$python" -m venv --clear "$venv"
    mapfile -t torch < <(grep -E '^(torch|torchvision)==' "$lock")
    say "installing ${torch[*]}"
    if [ -z "$torch_index" ] ||
        ! pip_install --no-deps --retries 1 --timeout 15 --index-url "$torch_index" "${torch[@]}"; then
        pip_install "${torch[@]}" || fail "pip could not install ${torch[*]}: see its message above."
    fi
    say "installing the other packages of $lock"
    # Without the hashes that some of the files have: torch may come from another index.
    pip_install --no-deps -r <(sed -E '/^(torch|torchvision)==/d; /^ +--hash=/d; s/ \\$//' "$lock") ||
        fail "pip could not install $lock: see its message above."
    # Its entry points: learners, policies and robots are found by them.
    pip_install --no-deps --no-build-isolation -e . || fail "pip could not install robospa itself."
    "$venv/bin/python" -c "import torch, lerobot" || fail "torch or lerobot cannot be imported: see above."
    printf '%s' "$now" >"$venv/.robospa-models"
}

if [ "${BASH_SOURCE[0]}" = "$0" ]; then make_environment; fi
