#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Installs what the project needs on Debian 12: packages by apt (sudo only when not root), the emulator's node modules, a Python
# virtual environment. Does nothing that was done before: each part leaves a stamp that names its list's checksum.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
stamps=$root/build/setup
mkdir -p "$stamps"

as_root() {
    if [ "$(id -u)" = 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        echo "setup: not root and no sudo: as root, run: $*" >&2
        exit 1
    fi
}

# stamp NAME FILE...: the stamp's path, which changes when one of the files does.
stamp() {
    local name=$1
    shift
    echo "$stamps/$name-$(cat "$@" | sha256sum | cut -c1-16)"
}

install_apt() {
    local done missing=() package
    done=$(stamp apt "$here/apt.txt")
    [ -e "$done" ] && return
    while read -r package; do
        dpkg-query -W -f='${db:Status-Status}\n' "$package" 2>/dev/null | grep -qx installed || missing+=("$package")
    done < <(grep -v '^#' "$here/apt.txt")
    # A newer node from elsewhere brings its own npm; Debian's npm would clash with it.
    command -v npm >/dev/null || missing+=(nodejs npm)
    if [ ${#missing[@]} -gt 0 ]; then
        echo "setup: installing ${#missing[@]} Debian packages: ${missing[*]}"
        as_root apt-get update -q
        as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}"
    fi
    touch "$done"
}

install_node_modules() {
    local board=$root/tools/stagesim/board done
    done=$(stamp npm "$board/package.json")
    [ -e "$done" ] && [ -d "$board/node_modules" ] && return
    echo "setup: installing the emulated board's node modules"
    (cd "$board" && npm ci --no-audit --no-fund --loglevel=error)
    touch "$done"
}

install_venv() {
    local done
    done=$(stamp venv "$here/requirements.txt")
    [ -e "$done" ] && [ -x "$root/.venv/bin/python" ] && return
    echo "setup: making the Python environment .venv"
    python3 -m venv "$root/.venv"
    "$root/.venv/bin/python" -m pip install -q --disable-pip-version-check -r "$here/requirements.txt"
    touch "$done"
}

install_apt
install_node_modules
install_venv
