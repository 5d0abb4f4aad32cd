#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Measures the cold build of two commits of this repository, or of one, without compiler cache.
#   tests/bench/build_time.sh [OPTIONS] OLD [NEW]
#     --demo     only the programs that deploy/demo.sh builds
#     --tests    only everything that tests/run.sh builds
#     --jobs N   compile jobs (default: 2)
#     --keep     keep the temporary folder, with the logs
# Each part is configured and built from an empty folder, with the cmake commands of that commit's
# own script. CPU seconds are user + sys of configuring and building. Needs the packages of
# deploy/install-deps.sh; measure on an idle machine. TMPDIR needs about 6 GB.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)

usage() {
  sed -n '3,/^set /{/^set /d;s/^# \{0,1\}//;p}' "${BASH_SOURCE[0]}"
}

fail() {
  echo "build_time.sh: $*" >&2
  exit 1
}

parts=(demo tests)
jobs=2
keep=false
commits=()
while [ $# -gt 0 ]; do
  case "$1" in
    --demo) parts=(demo) ;;
    --tests) parts=(tests) ;;
    --jobs)
      [[ "${2:-}" =~ ^[1-9][0-9]*$ ]] || fail "--jobs takes a number of jobs, e.g. --jobs 2"
      jobs=$2
      shift
      ;;
    --keep) keep=true ;;
    -h | --help)
      usage
      exit
      ;;
    -*) fail "unknown option $1; --help lists them" ;;
    *)
      commits+=("$(git -C "$root" rev-parse --verify --quiet "$1^{commit}")") ||
        fail "no commit '$1' in $root"
      ;;
  esac
  shift
done
if [ ${#commits[@]} -lt 1 ] || [ ${#commits[@]} -gt 2 ]; then
  fail "name one or two commits; --help shows how"
fi

work=$(mktemp -d -t rigcal_build_time.XXXXXX)
if $keep; then
  echo "logs and clones: $work"
else
  trap 'rm -rf "$work"' EXIT
fi

declare -A script=([demo]=deploy/demo.sh [tests]=tests/run.sh)
declare -A cpu wall

# The first cmake command of a script that begins with these words, on one line, without redirection.
command_of() { # SCRIPT PATTERN
  sed -e ':join' -e '/\\$/{N;s/\\\n//;b join' -e '}' "$1" |
    grep -m1 -E "^[[:space:]]*$2" | sed -E 's/[[:space:]]*[0-9&]*>.*$//'
}

# Runs the configuring and the building command of a commit's script, in the current folder.
build() { # SCRIPT
  local setting configure compile
  setting=$(grep -m1 -E '^preset=' "$1")
  configure=$(command_of "$1" 'cmake --preset') || return 1
  compile=$(command_of "$1" 'cmake --build') || return 1
  # The commands use these names of their script.
  # shellcheck disable=SC2034
  local warnings=OFF preset
  # shellcheck disable=SC2317
  nproc() { echo "$jobs"; }
  unset RIGCAL_PRESET
  eval "$setting"
  echo "+ $configure" && eval "$configure" && echo "+ $compile" && eval "$compile"
}

# Sets cpu[PART,WHICH] and wall[PART,WHICH].
measure() { # PART WHICH COMMIT
  local clone="$work/$2" log="$work/$2-$1.log" times="$work/$2-$1.time"
  if [ ! -d "$clone" ]; then
    git clone --quiet --shared --no-checkout "$root" "$clone"
    git -C "$clone" checkout --quiet --detach "$3"
  fi
  rm -rf "$clone/build"
  echo "building what ${script[$1]} builds at ${3:0:10} ..." >&2
  if ! (
    export CCACHE_DISABLE=1
    unset CXXFLAGS CFLAGS LDFLAGS CMAKE_BUILD_PARALLEL_LEVEL CI
    cd "$clone" || exit 1
    TIMEFORMAT='%U %S %R'
    { time build "${script[$1]}" >"$log" 2>&1; } 2>"$times"
  ); then
    tail -n 30 "$log" >&2
    fail "the build of ${3:0:10} failed"
  fi
  rm -rf "$clone/build"
  local user sys real
  read -r user sys real <"$times"
  cpu[$1,$2]=$(awk -v u="$user" -v s="$sys" 'BEGIN { printf "%.1f", u + s }')
  wall[$1,$2]=$real
}

for part in "${parts[@]}"; do
  measure "$part" old "${commits[0]}"
  if [ ${#commits[@]} -eq 2 ]; then measure "$part" new "${commits[1]}"; fi
done

echo
if [ ${#commits[@]} -eq 1 ]; then
  printf '%s, %s jobs\n%-15s %12s %13s\n' "${commits[0]:0:10}" "$jobs" "" "CPU seconds" "wall seconds"
  for part in "${parts[@]}"; do
    printf '%-15s %12.0f %13.0f\n' "${script[$part]}" "${cpu[$part,old]}" "${wall[$part,old]}"
  done
else
  printf 'old %s, new %s, %s jobs\n' "${commits[0]:0:10}" "${commits[1]:0:10}" "$jobs"
  printf '%-15s %9s %9s %7s %10s %9s\n' "" "CPU s old" "new" "ratio" "wall s old" "new"
  for part in "${parts[@]}"; do
    ratio=$(awk -v o="${cpu[$part,old]}" -v n="${cpu[$part,new]}" 'BEGIN { printf "%.3f", n / o }')
    printf '%-15s %9.0f %9.0f %7s %10.0f %9.0f\n' "${script[$part]}" "${cpu[$part,old]}" \
      "${cpu[$part,new]}" "$ratio" "${wall[$part,old]}" "${wall[$part,new]}"
  done
fi
