#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Four GigE Vision cameras without hardware. Each fake camera serves the frames of one simulated
# camera over the real protocol, on a loopback address of its own. One agent per camera captures
# them and finds the wand, and one server calibrates the rig. Called by deploy/demo.sh --gige, which
# builds first.
set -euo pipefail
# GigE Vision has a fixed port, so four cameras need four addresses. They are added to the loopback
# device of a separate network namespace; the machine's network stays unchanged.
if [ "${RIGCAL_DEMO_NETWORK:-}" != own ]; then
  RIGCAL_DEMO_NETWORK=own exec unshare --user --map-root-user --net "$0" "$@"
fi
ip link set lo up
for i in 2 3 4; do ip address add "127.0.0.$i/8" dev lo; done
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
bin=$root/build/release/bin
seconds=${RIGCAL_DEMO_SECONDS:-20}
target="wand:0,0.13,0.39;diameter=0.04;hz=500"
world="cameras=4;rate=20;duration=$((seconds + 20));clutter=0.5;lux=300"

folder=$(mktemp -d)
pids=()
end() {
  for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
  wait 2>/dev/null || true
  rm -rf "$folder"
}
trap end EXIT

# Waits for a file that a program writes when it is ready.
await() {
  for _ in $(seq 300); do
    [ -s "$1" ] && return
    sleep 0.1
  done
  echo "demo: timed out waiting for $1; see the messages of the programs above" >&2
  exit 1
}

"$bin/rigcal-server" --listen 127.0.0.1:0 --data-dir "$folder/server" \
  --port-file "$folder/port" --log-level warn &
pids+=($!)
await "$folder/port"
export RIGCAL_SERVER="127.0.0.1:$(cat "$folder/port")"

for i in 0 1 2 3; do
  "$bin/rigcal-fake-gige-camera" --address "127.0.0.$((i + 1))" --serial "RIGCAL0$i" \
    --pixel-format BayerRG8 --simulation "camera=$i;$world" --target "$target" --threads 1 \
    --write-calibration "$folder/gige_$i.yaml" >"$folder/camera_$i.log" 2>&1 &
  pids+=($!)
done
for i in 0 1 2 3; do await "$folder/gige_$i.yaml"; done
sleep 2 # the first frames are rendered ahead
for i in 0 1 2 3; do
  "$bin/rigcal-agent" --server "$RIGCAL_SERVER" --state-dir "$folder/agent_$i" --log-level warn \
    --source "gige_$i=aravis:127.0.0.$((i + 1));calibration=$folder/gige_$i.yaml;pixel_format=BayerRG8" &
  pids+=($!)
done
for _ in $(seq 100); do
  connected=$("$bin/rigcal" agent list -o json | grep -c '"connected": *true' || true)
  [ "$connected" -ge 4 ] && break
  sleep 0.2
done
"$bin/rigcal" agent list

"$bin/rigcal" session create --id gige --target "$target" --start >/dev/null
echo "waving for $seconds s" >&2
sleep "$seconds"
"$bin/rigcal" session stop gige --wait >/dev/null
"$bin/rigcal" session get gige
"$bin/rigcal" calibrate gige --wait "$@"
