#!/usr/bin/env bash
# Lock what requirements/*.in ask for, with hashes and without any address.
#
# usage: tools/lock.sh PATH-OF-UV
set -euo pipefail
uv=$(realpath "$1")
cd "$(dirname "$0")/../requirements"
for wanted in *.in; do
    alone=()
    [[ $wanted != @(kachaka|recording).in ]] || alone=(--no-deps)
    "$uv" --no-config pip compile --quiet --upgrade --generate-hashes \
        --universal --python-version 3.10 "${alone[@]}" \
        --custom-compile-command 'make lock' --constraint constraints.txt \
        --output-file "${wanted%.in}.txt" "$wanted"
done
