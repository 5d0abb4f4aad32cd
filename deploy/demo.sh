#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what is missing, builds rigcal and calibrates through real processes on this machine.
#   deploy/demo.sh                    a simulated rig of 6 cameras, compared with its truth
#   deploy/demo.sh --pixels           four simulated cameras whose agents find the wand in rendered pictures
#   deploy/demo.sh --events           four such cameras and two event cameras (rendering events takes a minute or two)
#   deploy/demo.sh --gige             the same pictures over GigE Vision, from fake cameras on loopback
#   deploy/demo.sh DIR [OPTIONS]      a recorded rig: DIR has <camera>.yaml and <camera>.csv for each camera
# OPTIONS go to `rigcal local` (deploy/demo.sh DIR -o json). RIGCAL_TARGET names another wand.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

"$root/deploy/install-deps.sh"
# Two checkouts of the same sources share what ccache has compiled.
export CCACHE_BASEDIR=$root CCACHE_NOHASHDIR=1
(
  cd "$root"
  cmake --preset release -DRIGCAL_BUILD_TESTS=OFF >/dev/null
  cmake --build --preset release -j "$(nproc)" --target rigcal rigcal-server rigcal-agent
) >&2

if [ "${1:-}" = --gige ]; then
  shift
  (
    cd "$root"
    cmake --preset release -DRIGCAL_BUILD_TESTS=ON >/dev/null
    cmake --build --preset release -j "$(nproc)" --target rigcal-fake-gige-camera
  ) >&2
  exec "$root/deploy/demo-gige.sh" "$@"
fi
if [ "${1:-}" = --pixels ]; then
  shift
  exec "$root/build/release/bin/rigcal" local \
    --simulate "cameras=4;duration=20;pixels=1;clutter=0.5;lux=300" \
    --target "wand:0,0.13,0.39;diameter=0.04;hz=500" "$@"
fi
if [ "${1:-}" = --events ]; then
  shift
  exec "$root/build/release/bin/rigcal" local \
    --simulate "cameras=6;duration=15;pixels=1;events=2;lux=300" \
    --target "wand:0,0.13,0.39;diameter=0.04;hz=500" "$@"
fi

target=${RIGCAL_TARGET:-wand:0,0.13,0.39}
if [ $# -gt 0 ] && [ "${1#-}" = "$1" ]; then
  data=$1
  shift
  exec "$root/build/release/bin/rigcal" local --data "$data" --target "$target" "$@"
fi
exec "$root/build/release/bin/rigcal" local --simulate "" --target "$target" "$@"
