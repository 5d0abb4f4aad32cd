#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A session from its creation to its calibration, by the JSON API: session.sh [URL] [SECONDS]
set -euo pipefail
url=${1:-http://127.0.0.1:7421}
seconds=${2:-20}

call() { # METHOD PATH [BODY]: the answer, also one that says why it is refused
  curl --silent --show-error --fail-with-body --request "$1" --header 'X-Rigcal: 1' ${3+--data "$3"} "$url$2"
}
field() { grep -o "\"$1\":\"[^\"]*\"" | head -n 1 | cut -d '"' -f 4; } # NAME: the first of this name
await() { # PATH STATES: the answer, once its state is one of them
  local answer
  while answer=$(call GET "$1"); do
    [[ $(field state <<<"$answer") =~ ^($2)$ ]] && echo "$answer" && return
    sleep 0.2
  done
  echo "$answer" >&2 && return 1
}

target='{"kind": "KIND_WAND", "marker_positions_m": [0, 0.13, 0.39]}'
session=$(call POST /v1/sessions "{\"title\": \"by curl\", \"target\": $target}" | field id)
call POST "/v1/sessions/$session:start" | field state
echo "session $session captures: wave for $seconds s"
sleep "$seconds"
call POST "/v1/sessions/$session:stop" | field state
await "/v1/sessions/$session" STATE_FINISHED | field state
calibration=$(call POST /v1/calibrations "{\"session_ids\": [\"$session\"]}" | field id)
answer=$(await "/v1/calibrations/$calibration" 'STATE_SUCCEEDED|STATE_FAILED|STATE_CANCELLED')
echo "calibration $calibration: $(field state <<<"$answer") $(field error <<<"$answer" || true)"
grep -o '"grade":"[^"]*"\|"headline":{[^}]*}' <<<"$answer" # how good it is
