#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what is missing, builds everything and runs every test. Lists what was skipped, and why.
#   tests/run.sh [CTEST OPTIONS]      e.g. tests/run.sh -R server/solve
#   tests/run.sh --quick              single folders only: no processes, no rendering, no long solves
#   RIGCAL_PRESET=asan tests/run.sh   another preset of CMakePresets.json (default: test)
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
preset=${RIGCAL_PRESET:-test}
jobs=$(nproc)

if [ "${1:-}" = --quick ]; then
  shift
  whole_programs='^(accuracy|bench|cases|client/dashboard|fuzz|golden|integration|second_renderer)/'
  set -- -E "$whole_programs" -LE slow "$@"
fi

"$root/deploy/install-deps.sh"
cd "$root"
# `buf lint` is one of the tests, and so is the reading of Parquet files by code of others. Debian has
# no packages of these; without network they are skipped.
modules=build/npm/node_modules
if [ ! -x $modules/.bin/buf ] || [ ! -d $modules/hyparquet ] && command -v npm >/dev/null; then
  npm install --prefix build/npm --no-save --no-audit --no-fund --silent \
    @bufbuild/buf@1.75.0 hyparquet@1.17.1 || true
fi
cmake --preset "$preset" -DRIGCAL_BUILD_TESTS=ON >/dev/null
log=build/$preset/build.log
cmake --build --preset "$preset" -j "$jobs" 2>&1 | tee "$log"
# A warning ends continuous integration here, not by -Werror: with other flags it could not share
# the compiler cache with a user's build. The cache repeats warnings.
if [ "${CI:-}" = true ] && grep -q ' warning: ' "$log"; then
  echo
  echo "The compiler warned; fix these first:"
  grep ' warning: ' "$log" | sort -u
  exit 1
fi

# CHOLMOD and OpenMP stall busy machines; nothing here needs their threads.
export OMP_THREAD_LIMIT=1
log=build/$preset/ctest.log
status=0
ctest --preset "$preset" -j "$jobs" "$@" 2>&1 | tee "$log" || status=$?

if grep -q '(Skipped)' "$log"; then
  echo
  echo "Skipped:"
  grep '(Skipped)' "$log" | sed 's/^\s*[0-9]* - /  /' | sort -u
fi
exit "$status"
