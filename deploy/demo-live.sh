#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A simulated rig in real time: one server, six agents with a simulated camera each, a session that
# captures, and the dashboard to look at. Called by deploy/demo.sh --live, which builds first.
# Ends with Ctrl-C, or when the session ends.
# RIGCAL_DEMO_SECONDS: length of the wave [600].
# RIGCAL_DEMO_UNTIL_MM: the session ends by itself at this expected error; unset: it does not.
# RIGCAL_DEMO_PROGRAMS: folder of the programs [build/release/bin].
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
programs=${RIGCAL_DEMO_PROGRAMS:-$root/build/release/bin}
seconds=${RIGCAL_DEMO_SECONDS:-600}
cameras=6

folder=$(mktemp -d)
pids=()
end() {
  for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
  wait 2>/dev/null || true
  rm -rf "$folder"
}
trap end EXIT
trap 'exit 130' INT TERM

"$programs/rigcal-server" --listen 127.0.0.1:0 --data-dir "$folder/data" --port-file "$folder/port" \
  --http-port-file "$folder/http_port" --log-level warn &
pids+=($!)
for _ in $(seq 100); do
  [ -s "$folder/port" ] && [ -s "$folder/http_port" ] && break
  kill -0 "${pids[0]}" 2>/dev/null || exit 1
  sleep 0.1
done
server=127.0.0.1:$(cat "$folder/port")

for i in $(seq 0 $((cameras - 1))); do
  "$programs/rigcal-agent" --server "$server" --state-dir "$folder/agent$i" --log-level warn \
    --source "sim:camera=$i;cameras=$cameras;rate=50;duration=$seconds;speed=1;offset.2=-0.008" &
  pids+=($!)
done
for _ in $(seq 100); do
  connected=$("$programs/rigcal" --server "$server" agent list 2>/dev/null | grep -c connected || true)
  [ "$connected" -eq "$cameras" ] && break
  sleep 0.1
done

cat >&2 <<EOF

The dashboard:  http://127.0.0.1:$(cat "$folder/http_port")
Six simulated cameras at 50 frames/s see a wave of $seconds s; the clock of sim_2 is 8 ms off.
Below is the same in the terminal; Ctrl-C ends everything.

EOF
"$programs/rigcal" --server "$server" session create --id wave --target wand:0,0.13,0.39 --start \
  ${RIGCAL_DEMO_UNTIL_MM:+--until-mm "$RIGCAL_DEMO_UNTIL_MM"} >/dev/null
"$programs/rigcal" --server "$server" watch --session wave
