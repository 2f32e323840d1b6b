#!/bin/sh
# Prints the path of a usable Python, or says in one sentence what is missing and exits with 2.
# PYTHON=... names the interpreter to use instead of searching for one.
set -u

refuse() {
    echo "workbench: $1" >&2
    exit 2
}

new_enough() {
    "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1
}

# An interpreter on PATH may be a launcher of a version that is not installed, so each one is run.
python=
if [ -n "${PYTHON:-}" ]; then
    new_enough "$PYTHON" || refuse "PYTHON=$PYTHON is not a Python of version 3.11 or later; name one that is, or unset PYTHON to have it searched for."
    python=$PYTHON
else
    for candidate in python3.13 python3.12 python3.11 python3 python; do
        if new_enough "$candidate"; then
            python=$candidate
            break
        fi
    done
    [ -n "$python" ] || refuse "Python 3.11 or later is needed and none was found; install one (Debian, Ubuntu: sudo apt install python3 python3-venv) or name it: make PYTHON=/path/to/python3.11 ..."
fi

version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
"$python" -c 'import venv, ensurepip' >/dev/null 2>&1 ||
    refuse "Python $version lacks the modules venv and ensurepip; install them (Debian, Ubuntu: sudo apt install python$version-venv)."

# A compiler without the C library's headers is found by compiling.
scratch=$(mktemp -d) || refuse "no temporary folder can be created; set TMPDIR to a folder that can be written."
trap 'rm -rf "$scratch"' EXIT
printf '#include <math.h>\ndouble f(double x) { return floor(x); }\n' >"$scratch/probe.c"
compiler=
for candidate in cc gcc clang; do
    if "$candidate" -shared -fPIC -o "$scratch/probe.so" "$scratch/probe.c" >/dev/null 2>&1; then
        compiler=$candidate
        break
    fi
done
[ -n "$compiler" ] || refuse "a working C compiler (cc, gcc or clang, with the C library's headers) is needed and none was found; install one (Debian, Ubuntu: sudo apt install gcc libc6-dev)."

echo "$python"
