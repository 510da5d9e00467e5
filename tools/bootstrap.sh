#!/bin/sh
# Sets up .venv and runs, tests or measures acqd: what `make run|test|bench` do, for a machine without make.
#   sh tools/bootstrap.sh run [arguments of acqd run, or --demo KIND] | demo [arguments of acqd try] | test | slow |
#   lint | bench | faults | sbom [EXTRA] | install EXTRA
set -eu
cd "$(dirname "$0")/.."
venv=${ACQD_VENV:-.venv}

say() { printf 'acqd setup: %s\n' "$*" >&2; }

find_python() {
    for candidate in ${PYTHON:-python3.13 python3.12 python3.11 python3}; do
        if "$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null; then
            echo "$candidate"
            return
        fi
    done
    say "no Python 3.11 to 3.13 found. On Debian 12 or Ubuntu 24.04: sudo apt-get install python3 python3-venv"
    exit 1
}

make_venv() {
    [ -x "$venv/bin/python" ] && return
    python=$(find_python)
    if ! "$python" -c 'import venv, ensurepip' 2>/dev/null; then
        say "$python has no venv module: sudo apt-get install python3-venv (or python3.x-venv for your version)"
        exit 1
    fi
    say "making $venv with $("$python" --version)"
    "$python" -m venv "$venv"
}

# install EXTRAS: once, and again whenever pyproject.toml or the constraints change
install() {
    make_venv
    stamp="$venv/.acqd-${1:-core}"
    if [ -e "$stamp" ] && [ "$stamp" -nt pyproject.toml ] && [ "$stamp" -nt constraints.txt ]; then
        return
    fi
    say "installing acqd${1:+[$1]}, a minute or two the first time"
    # Of the many modules few are imported: Python compiles those then, rather than pip all of them now.
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt \
        -e ".${1:+[$1]}"
    touch "$stamp"
}

# Modules are compiled when they are first imported. Workers that start together would each compile all of them.
compile_once() {
    stamp="$venv/.acqd-compiled"
    [ "$stamp" -nt "$venv/.acqd-browser" ] && return
    say "compiling modules and tests, half a minute the first time"
    "$venv/bin/python" -m pytest --collect-only -qq >/dev/null 2>&1 || true
    touch "$stamp"
}

have_servers() {
    PATH="$PATH:/usr/sbin:/usr/local/sbin"
    for program in mosquitto tshark mbpoll ip; do
        command -v $program >/dev/null 2>&1 || return 1
    done
    for initdb in /usr/lib/postgresql/*/bin/initdb "$(command -v initdb 2>/dev/null || true)"; do
        [ -x "$initdb" ] && return 0
    done
    return 1
}

# The tests speak to a real broker and a real database, on private ports and folders, and have the
# protocol doubles checked by other people's clients (tshark, mbpoll).
install_servers() {
    have_servers && return
    packages="mosquitto postgresql tshark mbpoll iproute2"
    if ! command -v apt-get >/dev/null 2>&1; then
        say "the tests need $packages; install them with your package manager and try again"
        exit 1
    fi
    if [ "$(id -u)" = 0 ]; then
        sudo=
    elif sudo -n true 2>/dev/null; then
        sudo="sudo -n"
    else
        say "the tests need $packages and this user may not install them: sudo apt-get install $packages"
        exit 1
    fi
    say "installing $packages from the distribution"
    $sudo apt-get update -qq
    DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -qq --no-install-recommends $packages >/dev/null
}

# The tests of pages run in headless Chromium. Where the distribution has no package of it, they are skipped.
install_browser() {
    if command -v chromium >/dev/null 2>&1 || ! command -v apt-get >/dev/null 2>&1; then
        return 0
    fi
    if [ "$(id -u)" = 0 ]; then
        sudo=
    elif sudo -n true 2>/dev/null; then
        sudo="sudo -n"
    else
        say "no chromium, and this user may not install it: the tests of pages are skipped"
        return 0
    fi
    say "installing chromium from the distribution"
    for attempt in 1 2; do
        DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -qq --no-install-recommends chromium >/dev/null 2>&1 &&
            return 0
        [ $attempt = 2 ] || $sudo apt-get update -qq || true
    done
    say "chromium could not be installed: the tests of pages are skipped"
}

install_tests() {
    { install_servers && install_browser; } & # both mostly wait for the network
    servers=$!
    trap 'wait' EXIT # leave no installation behind that still runs
    install browser
    wait $servers
    # Where it is set, hundreds of processes would each compile every module that they import again.
    unset PYTHONDONTWRITEBYTECODE
}

# Three workers take one test after the other, the long ones first (tests/conftest.py): one those that wait for
# devices and brokers, two those that compute (tests/schedule.py). Slow tests run where their sources have changed
# (tests/slow.py). At the end: why tests failed or were skipped.
run_tests() {
    compile_once
    "$venv/bin/python" -m pytest -n 3 --dist loadgroup --no-loadscope-reorder --slow changed -rfEs "$@"
}

# stops at the first check that complains
lint() {
    "$venv/bin/ruff" check acqd tests tools
    "$venv/bin/ruff" format --check -q acqd tests tools
    "$venv/bin/mypy"
    "$venv/bin/lint-imports" --no-logo 2>/dev/null || "$venv/bin/lint-imports"
}

# What is installed with acqd[EXTRA] (postgres by default), in a fresh environment: acqd.cdx.json (CycloneDX) and,
# with hashes of the files for this platform and Python, requirements.lock.
describe_packages() {
    install sbom
    clean=$(mktemp -d)
    trap 'rm -rf "$clean"' EXIT
    "$venv/bin/python" -m venv "$clean/venv"
    say "installing acqd${1:+[$1]} into an empty environment"
    "$clean/venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt \
        --report "$clean/report.json" -e ".${1:+[$1]}"
    "$venv/bin/cyclonedx-py" environment --pyproject pyproject.toml --output-reproducible --of JSON \
        -o acqd.cdx.json "$clean/venv/bin/python"
    "$venv/bin/python" -m tools.vendored acqd.cdx.json
    "$venv/bin/python" -m tools.lock "$clean/report.json" >requirements.lock
    say "wrote acqd.cdx.json and requirements.lock"
}

command=${1:-}
[ $# -gt 0 ] && shift
case "$command" in
run)
    case " $* " in *" --demo"*)
        install hw
        exec "$venv/bin/python" -m tools.demo "$@"
        ;;
    esac
    install ""
    exec "$venv/bin/acqd" run "$@"
    ;;
demo)
    install lab,loop
    exec "$venv/bin/acqd" try "$@"
    ;;
install)
    install "${1:-}"
    ;;
sbom)
    describe_packages "${1:-postgres}"
    ;;
lint)
    install dev
    lint
    ;;
slow)
    install_tests
    status=0
    run_tests -m slow "$@" || status=$?
    [ $status = 5 ] || exit $status # 5: no test selected, because nothing has changed
    ;;
test)
    install_tests
    [ $# -gt 0 ] || say "lint, types, layers and tests: seven to nine minutes on two idle cores, fourteen with all slow tests"
    begun=$(date +%s)
    complaints=$(mktemp)
    # while tests wait for devices and brokers there is time for the checks
    lint >"$complaints" 2>&1 &
    checks=$!
    trap 'kill $checks 2>/dev/null || true; rm -f "$complaints"
          took=$(($(date +%s) - begun)); say "make test took $((took / 60)) min $((took % 60)) s"' EXIT
    status=0
    run_tests "$@" || status=$?
    if wait $checks; then
        say "lint, types and layers: no complaints"
    else
        say "lint, types or layers complain:"
        cat "$complaints" >&2
        [ $status -ne 0 ] || status=1
    fi
    exit $status
    ;;
bench)
    install_servers
    install bench
    exec "$venv/bin/python" -m tools.bench "$@"
    ;;
faults | soak)
    install_servers
    install dev
    exec "$venv/bin/python" -m "tools.studies.$command" "$@"
    ;;
*)
    say "usage: sh tools/bootstrap.sh run|demo|test|slow|lint|bench|faults|soak|sbom|install"
    exit 2
    ;;
esac
