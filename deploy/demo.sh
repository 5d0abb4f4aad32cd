#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs missing packages, builds rigcal and runs a calibration with real processes on this
# machine.
#   deploy/demo.sh                the rig of the eWand paper, simulated: four frame cameras whose
#                                 agents find the wand in rendered frames at 50 Hz, two event
#                                 cameras whose agents find it in rendered events at 200 Hz, one
#                                 server; compared with ground truth
#   deploy/demo.sh --offset       the same with the clock of one event camera 4 ms off, and how much
#                                 of it is recovered
#   deploy/demo.sh --markers      six simulated cameras without rendered frames, 60 s of waving in
#                                 seconds
#   deploy/demo.sh --pixels       four frame cameras with rendered frames, in a dim room
#   deploy/demo.sh --office       the same in an office: windows, shelves, screens, people, light from
#                                 above, sensors with a Bayer mosaic
#   deploy/demo.sh --office dark  with the same cameras and the same wand at night, to compare with
#   deploy/demo.sh --from-scratch two frame cameras and an event camera without any lens file: each
#                                 lens from a board that is held before its camera, then the rig from
#                                 a wand; compared with ground truth
#   deploy/demo.sh --gige         the same frames over GigE Vision, from fake cameras on loopback
#   deploy/demo.sh --network [cut | one-way | loss]
#                                 three PCs, as network namespaces of this machine: two with cameras
#                                 join a server over TLS, and the link of one of them fails in the
#                                 middle of the recording; skipped where namespaces are not allowed
#   deploy/demo.sh --live         a simulated rig in real time, with the dashboard to look at
#   deploy/demo.sh DIR [OPTIONS]  a recorded rig: DIR has, for each camera, <camera>.yaml and
#                                 <camera>.csv (markers) or .raw, .h5, .hdf5 (events)
# OPTIONS go to `rigcal local` (deploy/demo.sh DIR -o json). RIGCAL_TARGET names another target.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

"$root/deploy/install-deps.sh"
(
  cd "$root"
  cmake --preset release -DRIGCAL_BUILD_TESTS=OFF >/dev/null
  cmake --build --preset release -j "$(nproc)" --target rigcal rigcal-server rigcal-worker rigcal-agent
) >&2

rigcal=$root/build/release/bin/rigcal
paper_rig="cameras=6;duration=15;rate=50;pixels=1;events=2;lux=300"
spheres="wand:0,0.13,0.39;diameter=0.04;hz=500"

say() { printf '%s\n' "$@" >&2; }

say_rig() {
  say "" "Simulating the rig of the eWand paper: 15 s of waving a wand of three spheres that blink at 500 Hz" \
    "  sim_0 to sim_3  frame cameras, 1280x1024, 50 frames/s, exposure 5 ms; frames are rendered and searched" \
    "  sim_4, sim_5    event cameras, 1280x720, 5 noise events/s and pixel, hot pixels, moving bars, lamps of" \
    "                  100 and 120 Hz; events are rendered, decoded and searched, 200 outputs/s" \
    "One agent per camera and one server, on this machine. This takes 20 to 60 s, mostly for the events." ""
}

case "${1:-}" in
  --gige)
    shift
    (
      cd "$root"
      cmake --preset release -DRIGCAL_BUILD_TESTS=ON >/dev/null
      cmake --build --preset release -j "$(nproc)" --target rigcal-fake-gige-camera
    ) >&2
    exec "$root/deploy/demo-gige.sh" "$@"
    ;;
  --live)
    shift
    exec "$root/deploy/demo-live.sh" "$@"
    ;;
  --network)
    shift
    exec "$root/deploy/demo-network.sh" "$@"
    ;;
  --pixels)
    shift
    exec "$rigcal" local --simulate "cameras=4;duration=20;pixels=1;clutter=0.5;lux=300" --target "$spheres" "$@"
    ;;
  --office)
    shift
    office="rod=0.012;held=1;bayer=1;led_cd_m2=300;auto_gain=1"
    if [ "${1:-}" = dark ]; then
      shift
    else
      office+=";lux=400;overhead_lux=300;windows=1;shelves=1.5;screens=1;lights=1.5;people=0.3"
    fi
    exec "$rigcal" local --simulate "cameras=4;duration=20;pixels=1;$office" --target "$spheres" "$@"
    ;;
  --from-scratch)
    shift
    folder=$(mktemp -d)
    trap 'rm -rf "$folder"' EXIT
    for camera in 0 1 2; do
      board=board:checker,9x6,0.04
      source="sim:camera=$camera;cameras=3;near=1;pixels=1;rate=2;duration=20;speed=max"
      if [ "$camera" = 2 ]; then
        board=board:circles,4x11,0.0235,0.01828
        source="sim:camera=2;cameras=3;near=1;events=1;duration=30;speed=max"
      fi
      say "" "the lens of sim_$camera, from $board:"
      "$root/build/release/bin/rigcal-agent" intrinsics "sim_$camera=$source" --board "$board" \
        --output "$folder/sim_$camera.yaml"
    done
    say "" "the rig, from 15 s of waving a wand, with these lenses:"
    "$rigcal" local --simulate "cameras=3;duration=15;rate=50;pixels=1;events=1;lux=300" \
      --lenses "$folder" --target "$spheres" "$@"
    exit
    ;;
  --markers)
    shift
    exec "$rigcal" local --simulate "" --target "${RIGCAL_TARGET:-wand:0,0.13,0.39}" "$@"
    ;;
  --offset)
    say_rig
    folder=$(mktemp -d)
    trap 'rm -rf "$folder"' EXIT
    for offset in 0 0.004; do
      say "with an offset of $offset s on sim_5 ..."
      "$rigcal" local --simulate "$paper_rig;offset.5=$offset" --target "$spheres" -o json >"$folder/$offset"
    done
    # In the JSON a camera's name comes before its offset.
    awk -v OFS='\t' '
      /"camera":/ { name = $2; gsub(/[",]/, "", name) }
      /"time_offset_s":/ { offset[name, FILENAME] = 1000 * $2; if (FNR == NR) names[++count] = name }
      END {
        print "  time offset against sim_0 (ms)"
        printf "  %-8s%12s%22s%14s\n", "camera", "without", "with 4 ms on sim_5", "difference"
        for (i = 1; i <= count; ++i) {
          before = offset[names[i], ARGV[1]] - offset[names[1], ARGV[1]]
          after = offset[names[i], ARGV[2]] - offset[names[1], ARGV[2]]
          printf "  %-8s%12.3f%22.3f%14.3f\n", names[i], before, after, after - before
        }
      }' "$folder/0" "$folder/0.004"
    exit
    ;;
esac

target=${RIGCAL_TARGET:-wand:0,0.13,0.39}
if [ $# -gt 0 ] && [ "${1#-}" = "$1" ]; then
  data=$1
  shift
  exec "$rigcal" local --data "$data" --target "$target" "$@"
fi
if [ "${1:-}" = --events ]; then shift; fi # former name of the default
say_rig
exec "$rigcal" local --simulate "$paper_rig" --target "${RIGCAL_TARGET:-$spheres}" "$@"
