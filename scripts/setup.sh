#!/usr/bin/env bash
# Make a virtual environment with the suite and everything it needs: scripts/setup.sh [directory] (default .venv).
# Works on a bare Debian or Ubuntu machine with Python 3.11, 3.12 or 3.13; GBAS_PYTHON names an interpreter to use instead.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
venv=${1:-.venv}
unset PYTHONPATH PYTHONHOME VIRTUAL_ENV  # a sourced ROS environment would shadow the pinned packages
# An activated environment must not be made anew with the interpreter that goes with it.
PATH=$(tr ':' '\n' <<<"$PATH" | grep -vxF -e "$(realpath -m "$venv")/bin" -e "$(realpath -ms "$venv")/bin" | paste -sd:)

say() { printf 'setup: %s\n' "$*"; }
die() { printf 'setup: %s\n' "$*" >&2; exit 1; }

apt_install() {
    command -v apt-get >/dev/null || die "$1 is missing; install it with this system's package manager"
    [ "$(id -u)" = 0 ] || die "$1 is missing; run: sudo apt-get install $1"
    say "installing $1"
    export DEBIAN_FRONTEND=noninteractive
    apt-get install -y -qq "$1" >/dev/null 2>&1 || { apt-get update -qq && apt-get install -y -qq "$1" >/dev/null; }
}

# Each candidate is run, not only looked up: version managers put stand-ins on the path that do not start.
usable() { "$1" -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12), (3, 13)))' </dev/null >/dev/null 2>&1; }

find_python() {
    local candidate
    if [ -n "${GBAS_PYTHON:-}" ]; then
        usable "$GBAS_PYTHON" || die "GBAS_PYTHON=$GBAS_PYTHON is not a Python 3.11, 3.12 or 3.13"
        echo "$GBAS_PYTHON"
        return
    fi
    for candidate in python3.12 python3.11 python3.13 python3 \
        /usr/bin/python3.12 /usr/bin/python3.11 /usr/bin/python3.13 /usr/bin/python3 \
        "${HOME:-}"/.pyenv/versions/3.1[123].*/bin/python; do
        if usable "$candidate"; then
            echo "$candidate"
            return
        fi
    done
    return 1
}

make_venv() {
    local python version
    python=$(find_python) || {
        apt_install python3
        python=$(find_python) || die "no Python 3.11, 3.12 or 3.13 found; install one, or name it in GBAS_PYTHON"
    }
    version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])' </dev/null)
    say "Python $version ($python)"
    "$python" -c 'import ensurepip' 2>/dev/null </dev/null || apt_install "python$version-venv"
    rm -rf "$venv"
    "$python" -m venv "$venv"
}

# uv installs in parallel, in less than half of pip's time; where it cannot be had, pip does the same job.
install() {
    local index=${PIP_INDEX_URL:-$("$venv/bin/python" -m pip config get global.index-url 2>/dev/null || true)}
    [ -z "$index" ] || export UV_INDEX_URL="$index"
    if [ -x "$venv/bin/uv" ] &&
        "$venv/bin/uv" pip install -q --system-certs --python "$venv/bin/python" "$@" 2>"$venv/uv.log"; then
        return
    fi
    "$venv/bin/python" -m pip install -q --disable-pip-version-check --no-compile "$@"
}

started=$SECONDS
lock=$(cksum constraints.txt)
if [ ! -x "$venv/bin/python" ] || [ "$(cat "$venv/.lock" 2>/dev/null)" != "$lock" ]; then
    make_venv
    "$venv/bin/python" -m pip install -q --disable-pip-version-check --no-compile "$(grep '^uv==' constraints.txt)" 2>/dev/null ||
        say "no uv here; pip will do"
    say "installing the packages of constraints.txt"
    install --no-deps -r constraints.txt
    printf '%s\n' "$lock" >"$venv/.lock"
    say "packages installed after $((SECONDS - started)) s"
fi
editable=()
for package in src/*/setup.py; do
    editable+=(-e "$(dirname "$package")")
done
install --no-deps --no-build-isolation "${editable[@]}"
# An editable install carries no shared files: let the ament index of this environment point at the sources.
index=$venv/share/ament_index/resource_index/packages
mkdir -p "$index"
for package in src/*/package.xml; do
    name=$(basename "$(dirname "$package")")
    touch "$index/$name"
    ln -sfn "$PWD/src/$name" "$venv/share/$name"
done
# Byte code and compiled loops are kept beside their modules: made here, no node is late at its start, also where the
# environment keeps Python from writing byte code at each later one.
env -u PYTHONDONTWRITEBYTECODE "$venv/bin/python" -c '
import contextlib, importlib, pathlib, pkgutil
for name in sorted(path.parent.name for path in pathlib.Path("src").glob("*/setup.py")):
    for module in pkgutil.walk_packages(importlib.import_module(name).__path__, name + "."):
        with contextlib.suppress(ModuleNotFoundError):  # what only an installation of ROS has: launch
            importlib.import_module(module.name)
'
env -u PYTHONDONTWRITEBYTECODE "$venv/bin/python" -m gbas_bench.rehearsal
say "$venv is ready after $((SECONDS - started)) s"
