#!/usr/bin/env bash
# Everything that robospa needs on a bare Debian 12, Debian 13 or Ubuntu 24.04, and nothing twice.
#
#   bash scripts/setup.sh [--dev] [--dry-run]
#
# 1. a Python >= 3.11 with venv         (apt, only if it is missing)
# 2. .venv with the locked packages     (by hash: requirements.lock, with --dev requirements-dev.lock)
# 3. robospa itself, editable
# 4. a software Vulkan driver           (apt, only if SAPIEN finds no device that it can render with)
#
# --dev adds the test tools; --dry-run prints the commands that would change something. Run again,
# it looks and changes nothing. It asks no questions; without root and sudo it prints the command to
# run and goes on without pictures. Sourced, it only defines its functions: the tests do that.

set -euo pipefail

dry_run=${ROBOSPA_DRY_RUN:-0}
venv=.venv
lock=requirements.lock
os_release=${ROBOSPA_OS_RELEASE:-/etc/os-release}
apt_sources=/etc/apt/sources.list.d
# Asks for numpy 1 but runs with 2, hence installed without what it depends on.
openpi_client="openpi-client==0.1.2 --hash=sha256:2b4a64ab1f1e2d5a54ff1130314abca4f537f2568909ea0b8ec3dd4c7cd6b751 --hash=sha256:b8aa6d2ea7172d3b7c1fcf867d43930052b5ff19ea7b777966781105aa989897"
oldest="(3, 11)"

say() { printf 'setup: %s\n' "$*"; }

fail() {
    printf 'setup: %s\n' "$*" >&2
    exit 1
}

run() { # every command that changes something goes through here
    if [ "$dry_run" = 1 ]; then printf '+ %s\n' "$*"; else "$@"; fi
}

os_field() { # os_field ID: that value of /etc/os-release, or nothing
    [ -r "$os_release" ] || return 0
    (
        # shellcheck disable=SC1090
        . "$os_release"
        eval "printf '%s' \"\${$1:-}\""
    )
}

# --- system packages -----------------------------------------------------------------------------

root_prefix() { # how to become root; fails where nothing works
    if [ "$(id -u)" = 0 ]; then
        echo ""
    elif ! command -v sudo >/dev/null; then
        return 1
    elif [ -t 0 ]; then
        echo "sudo"
    else
        sudo -n true 2>/dev/null && echo "sudo -n"
    fi
}

apt_install() { # apt_install [-t SUITE] PACKAGE...: 0 installed, 1 could not, having said why
    local prefix log
    command -v apt-get >/dev/null || {
        say "there is no apt-get here: please install the equivalent of: $*"
        return 1
    }
    prefix=$(root_prefix) || {
        say "neither root nor sudo: please run: sudo apt-get update && sudo apt-get install -y $*"
        return 1
    }
    log=$(mktemp)
    # A foreign repository that does not answer must not stop us: only the install decides.
    run $prefix env DEBIAN_FRONTEND=noninteractive \
        apt-get -q -o DPkg::Lock::Timeout=120 update >"$log" 2>&1 || true
    [ "$dry_run" = 0 ] || cat "$log"
    if ! run $prefix env DEBIAN_FRONTEND=noninteractive \
        apt-get -q -o DPkg::Lock::Timeout=120 install -y --no-install-recommends "$@" >"$log" 2>&1; then
        say "apt-get could not install $*: $(grep -m1 '^E:' "$log" || tail -n1 "$log")"
        rm -f "$log"
        return 1
    fi
    [ "$dry_run" = 0 ] || cat "$log"
    rm -f "$log"
}

# --- Python --------------------------------------------------------------------------------------

python_ok() { "$1" -c "import sys; sys.exit(sys.version_info < $oldest)" 2>/dev/null; }

find_python() { # the first Python that is new enough; $PYTHON comes first
    local candidate
    for candidate in ${PYTHON:-} python3 python3.13 python3.12 python3.11; do
        if python_ok "$candidate"; then
            command -v "$candidate"
            return 0
        fi
    done
    return 1
}

can_make_venv() { "$1" -c "import ensurepip, venv" 2>/dev/null; }

ensure_venv() {
    local python version
    [ ! -x "$venv/bin/pip" ] || ! python_ok "$venv/bin/python" || return 0
    if ! python=$(find_python); then
        say "installing python3 and python3-venv with apt, because there is no Python >= 3.11"
        apt_install python3 python3-venv || fail "robospa needs Python >= 3.11 with venv."
        python=$(find_python) || fail "this system's python3 is older than 3.11; set PYTHON to a newer one."
    fi
    if ! can_make_venv "$python"; then
        version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
        say "installing python$version-venv with apt, because $python cannot make virtual environments"
        apt_install "python$version-venv" || fail "$python lacks venv; set PYTHON to one that has it."
    fi
    say "making $venv with $python"
    run "$python" -m venv --clear "$venv"
}

# --- packages ------------------------------------------------------------------------------------

pip_install() { run "$venv/bin/python" -m pip install -q --disable-pip-version-check "$@"; }

fingerprint() { # of the files named on standard input: names and contents
    sort | xargs -r sha256sum | sha256sum | cut -d' ' -f1
}

stamped() { [ -f "$venv/.robospa-$1" ] && [ "$(cat "$venv/.robospa-$1")" = "$2" ]; }

stamp() { [ "$dry_run" = 1 ] || printf '%s' "$2" >"$venv/.robospa-$1"; }

ensure_packages() {
    local kind=${lock%.lock} now
    now=$(printf '%s\n' "$lock" | fingerprint)
    stamped "$kind" "$now" && return 0
    if [ "$kind" = requirements ] && # the development lock contains this one
        stamped requirements-dev "$(echo requirements-dev.lock | fingerprint)"; then return 0; fi
    say "installing the packages of $lock (a minute or two)"
    pip_install --require-hashes -r "$lock" || fail "pip could not install $lock: see its message above."
    if [ "$kind" = requirements-dev ]; then
        pip_install --no-deps --require-hashes -r <(echo "$openpi_client") ||
            fail "pip could not install ${openpi_client%% *}."
    fi
    stamp "$kind" "$now"
}

ensure_project() {
    local now
    now=$(echo pyproject.toml | fingerprint)
    stamped project "$now" && return 0
    say "installing robospa itself into $venv"
    pip_install --no-deps --no-build-isolation -e . ||
        fail "pip could not install robospa itself: see its message above."
    stamp project "$now"
}

# --- Vulkan --------------------------------------------------------------------------------------

vulkan_usable() { # can SAPIEN open a device to render with? Its own answer, in half a second
    "$venv/bin/python" -c 'import sapien.render; sapien.render.RenderSystem()' >/dev/null 2>&1
}

vulkan_source() { # where this system's Mesa >= 24.3 comes from: backports, archive or unknown
    case "$(os_field ID) $(os_field VERSION_ID)" in
    "debian 12") echo backports ;;
    "debian 13" | "ubuntu 24.04" | "ubuntu 24.10" | "ubuntu 25."* | "ubuntu 26."*) echo archive ;;
    *) echo unknown ;;
    esac
}

add_backports() { # as a file of its own, unless some source has it already
    local prefix mirror file=$apt_sources/robospa-bookworm-backports.sources
    ! grep -qsr "bookworm-backports" "$apt_sources" "$(dirname "$apt_sources")/sources.list" || return 0
    mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Codename: bookworm' 2>/dev/null |
        grep -m1 -v security || true)
    [ -n "$mirror" ] || {
        say "apt lists no source of Debian 12: please add bookworm-backports to its sources"
        return 0
    }
    prefix=$(root_prefix) || {
        say "neither root nor sudo: please run first: echo 'deb $mirror bookworm-backports main' |" \
            "sudo tee ${file%.sources}.list"
        return 0
    }
    say "adding the package source bookworm-backports in $file"
    [ "$dry_run" = 0 ] || return 0
    printf '%s\n' "Types: deb" "URIs: $mirror" \
        "Suites: bookworm-backports" "Components: main" \
        "Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg" |
        $prefix tee "$file" >/dev/null
}

ensure_vulkan() {
    local where packages="mesa-vulkan-drivers libvulkan1 libx11-6"
    vulkan_usable && return 0
    where=$(vulkan_source)
    if [ "$where" = unknown ]; then
        say "SAPIEN finds no Vulkan device: please install Mesa >= 24.3 (its Vulkan drivers)."
    else
        say "installing Mesa's software Vulkan driver with apt ($packages)," \
            "because SAPIEN finds no Vulkan device to render with"
        if [ "$where" = backports ]; then
            add_backports
            # shellcheck disable=SC2086
            apt_install -t bookworm-backports $packages || true
        else
            # shellcheck disable=SC2086
            apt_install $packages || true
        fi
        [ "$dry_run" = 0 ] || return 0
        vulkan_usable && return 0
    fi
    say "going on without pictures: only physics will run. \`robospa check\` says what is missing."
}

main() {
    local option
    for option in "$@"; do
        case "$option" in
        --dev) lock=requirements-dev.lock ;;
        --dry-run) dry_run=1 ;;
        *) fail "unknown option $option; known are --dev and --dry-run." ;;
        esac
    done
    cd "$(dirname "${BASH_SOURCE[0]}")/.."
    ensure_venv
    ensure_packages
    ensure_project
    ensure_vulkan
}

if [ "${BASH_SOURCE[0]}" = "$0" ]; then main "$@"; fi
