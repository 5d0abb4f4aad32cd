#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Three PCs on one machine: a server and two PCs with cameras, each a network namespace with an
# address of its own, connected by a virtual switch. Both camera PCs join the server with a string
# and stream over TLS; in the middle of the recording the link of one of them fails and comes back.
# Called by deploy/demo.sh --network, which builds first.
#   deploy/demo-network.sh [cut | one-way | loss | impostor]
#     cut      the link is down, as with a pulled cable (default)
#     one-way  nothing from the server arrives at the PC; the server hears the PC
#     loss     2 % of the packets are lost, in both directions
#     impostor a fourth PC answers in the server's place while a PC joins, and learns nothing; no
#              recording
# RIGCAL_DEMO_SECONDS: length of the recording [36]; the fault lasts a third of it.
# RIGCAL_DEMO_PROGRAMS: folder of the programs [build/release/bin].
set -euo pipefail
fault=${1:-cut}
phase=$((${RIGCAL_DEMO_SECONDS:-36} / 3)) # seconds before, during and after the fault
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
programs=${RIGCAL_DEMO_PROGRAMS:-$root/build/release/bin}

skip() {
  echo "skipped: $1"
  exit 0
}
command -v ip >/dev/null || skip "network namespaces need ip (Debian: iproute2)"
case $fault in
  cut) ;;
  one-way | loss)
    command -v iptables >/dev/null || skip "the fault '$fault' needs iptables (Debian: iptables)"
    ;;
  impostor)
    command -v python3 >/dev/null || skip "the fault 'impostor' needs python3"
    ;;
  *)
    echo "demo-network: there is no fault '$fault'; use cut, one-way, loss or impostor" >&2
    exit 2
    ;;
esac

# In namespaces of its own, nobody needs to be root. They end with the last of these processes; the
# network of the machine stays unchanged.
if [ "${RIGCAL_DEMO_NETWORK:-}" != own ]; then
  own=(unshare --net --mount)
  [ "$(id -u)" -eq 0 ] || own+=(--user --map-root-user)
  why=$("${own[@]}" ip link add switch type bridge 2>&1) ||
    skip "network namespaces are not allowed here: $why"
  RIGCAL_DEMO_NETWORK=own exec "${own[@]}" "$0" "$fault"
fi

folder=$(mktemp -d)
pids=()
end() {
  for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
  wait 2>/dev/null || true
  rm -rf "$folder"
}
trap end EXIT
trap 'exit 130' INT TERM

stage() { printf '\n== %s\n' "$*"; }

# exec_on PC COMMAND...: this process becomes the command, on that PC: with its network, host name
# and home folder. It ends with the script, whatever ends that.
exec_on() {
  local pc=$1
  shift
  exec ip netns exec "$pc" unshare --uts setpriv --pdeathsig KILL \
    env -u RIGCAL_SERVER -u XDG_CONFIG_HOME -u XDG_DATA_HOME -u XDG_STATE_HOME \
    -C "$folder/$pc" HOME="$folder/$pc" PATH="$programs:$PATH" \
    bash -c 'hostname "$0" && exec "$@"' "$pc" "$@"
}
on() { (exec_on "$@"); }
# The same, shown as it would be typed there.
show() {
  local shown="$1\$" word
  for word in "${@:2}"; do
    case $word in *[\;\ ]*) word="'$word'" ;; esac
    shown+=" $word"
  done
  echo "$shown"
}
type_on() {
  show "$@"
  on "$@"
}
# A program that goes on running, with its messages in a file.
start_on() {
  show "$@"
  exec_on "$@" >"$folder/$1.log" 2>&1 &
  pids+=($!)
}
show_log() { sed -e 's/^/  /' "$folder/$1.log"; }
# await WHAT COMMAND...: until the command succeeds.
await() {
  for _ in $(seq 150); do
    "${@:2}" >/dev/null 2>&1 && return
    sleep 0.2
  done
  echo "demo-network: $1: not within 30 s. The last messages of the programs:" >&2
  tail -n 20 "$folder"/*.log >&2
  exit 1
}
both_are_connected() {
  [ "$(on server-pc rigcal agent list -o json | grep -c '"connected": *true')" -eq 2 ]
}

# The impostor has the server's address, too, and makes camera-pc-2 believe that it is his, as
# forged answers to ARP do.
lure() {
  echo "impostor-pc answers camera-pc-2 at 192.168.77.10"
  ip -n camera-pc-2 neighbour replace 192.168.77.10 dev eth0 nud permanent \
    lladdr "$(ip netns exec impostor-pc cat /sys/class/net/eth0/address)"
}
let_go() {
  echo "impostor-pc is gone"
  ip -n camera-pc-2 neighbour del 192.168.77.10 dev eth0
}
# refused PC COMMAND...: typed there; fails if the command does not.
refused() {
  show "$@"
  if on "$@" >"$folder/refused" 2>&1; then
    cat "$folder/refused"
    echo "demo-network: this had to be refused" >&2
    exit 1
  fi
  sed -e 's/^/  /' "$folder/refused"
}
# expect TEXT: the command before said so.
expect() {
  grep -qF -- "$1" "$folder/refused" && return
  echo "demo-network: the message had to say '$1'" >&2
  exit 1
}

impostor_stages() {
  stage "Somebody who wants to be taken for the server"
  plug impostor-pc 192.168.77.66
  local his=$folder/impostor-pc/.local/share/rigcal/identity true_ca=$folder/true.crt answer=$folder/ca-answer
  local seen=$folder/seen agent_string user_string identity
  # Anybody may fetch the server's CA.
  on impostor-pc python3 -c 'import ssl, urllib.request
print(urllib.request.urlopen("https://192.168.77.10:7421/v1/ca",
      context=ssl._create_unverified_context()).read().decode(), end="")' >"$true_ca"
  ip netns exec impostor-pc sh -c 'echo 8 >/proc/sys/net/ipv4/conf/all/arp_ignore'
  ip -n impostor-pc address add 192.168.77.10/32 dev eth0
  printf '[https]\nlisten = "0.0.0.0:7431"\n' >"$folder/impostor.toml"
  start_on impostor-pc rigcal-server --config "$folder/impostor.toml" --listen 0.0.0.0
  await "the impostor's server starts" on impostor-pc rigcal agent list
  cp "$true_ca" "$answer"
  exec_on impostor-pc python3 "$root/deploy/impostor.py" "$his/server.crt" "$his/server.key" \
    "$answer" "$seen" >"$folder/impostor.log" 2>&1 &
  pids+=($!)
  await "the impostor answers" on impostor-pc python3 -c \
    'import socket; socket.create_connection(("127.0.0.1", 7421), 1)'

  stage "A PC joins while he answers"
  agent_string=$(on server-pc rigcal token create --name camera-pc-2)
  user_string=$(on server-pc rigcal token create --role operator 2>/dev/null)
  lure
  local kind
  for kind in his both both-reversed twice chain true; do
    case $kind in
      his) cat "$his/ca.crt" ;;
      both) cat "$true_ca" "$his/ca.crt" ;;
      both-reversed) cat "$his/ca.crt" "$true_ca" ;;
      twice) cat "$true_ca" "$true_ca" "$his/ca.crt" ;;
      chain) cat "$his/server.crt" "$his/ca.crt" "$true_ca" ;;
      true) cat "$true_ca" ;;
    esac >"$answer"
    echo "he shows as the CA: $kind"
    refused camera-pc-2 rigcal-agent join "$agent_string"
    expect "othing was sent to it"
    refused camera-pc-2 rigcal login "$user_string"
    expect "othing was sent to it"
  done
  if [ -s "$seen" ]; then
    echo "demo-network: the impostor was sent: $(cat "$seen")" >&2
    exit 1
  fi
  echo "the impostor has seen no secret"

  stage "The same strings, and the server itself"
  let_go
  type_on camera-pc-2 rigcal-agent join "$agent_string"
  type_on camera-pc-2 rigcal login "$user_string"
  type_on camera-pc-2 rigcal doctor

  stage "Who has joined does not talk to him either"
  lure
  refused camera-pc-2 rigcal agent list
  expect "not of the CA that this PC trusts"
  refused camera-pc-2 rigcal doctor
  expect "is not the one that this user has joined"
  let_go

  stage "A folder that trusts him, as earlier versions may have left it"
  identity=$folder/camera-pc-2/.local/state/rigcal/agent/default/identity
  cat "$his/ca.crt" >>"$identity/ca.crt"
  refused camera-pc-2 rigcal-agent --source sim:camera=2
  expect "ca.crt holds 2 PEM blocks"
  refused camera-pc-2 rigcal doctor
  expect "ca.crt holds 2 PEM blocks"
  cp "$true_ca" "$identity/ca.crt"

  stage "A PC that is forgotten is told so"
  type_on server-pc rigcal agent forget camera-pc-2
  refused camera-pc-2 rigcal doctor
  expect "was revoked"
  if [ -s "$seen" ]; then
    echo "demo-network: the impostor was sent: $(cat "$seen")" >&2
    exit 1
  fi
}

stage "Three PCs and a switch"
mount -t tmpfs tmpfs /run # ip keeps the names of namespaces there
ip link add switch type bridge
ip link set switch up
plug() { # PC ADDRESS
  mkdir "$folder/$1"
  ip netns add "$1"
  ip link add "$1" type veth peer name eth0 netns "$1"
  ip link set "$1" master switch up
  ip -n "$1" link set lo up
  ip -n "$1" address add "$2/24" dev eth0
  ip -n "$1" link set eth0 up
  printf '%-12s %s\n' "$1" "$2"
}
plug server-pc 192.168.77.10
plug camera-pc-1 192.168.77.21
plug camera-pc-2 192.168.77.22

stage "A server that the network can reach"
start_on server-pc rigcal-server --listen 0.0.0.0
await "the server starts" on server-pc rigcal agent list
show_log server-pc

if [ "$fault" = impostor ]; then
  impostor_stages
  exit 0
fi

stage "Each PC with cameras joins with a string"
for pc in camera-pc-1 camera-pc-2; do
  show server-pc rigcal token create --name "$pc"
  string=$(on server-pc rigcal token create --name "$pc")
  echo "$string"
  type_on "$pc" rigcal-agent join "$string"
done

stage "Agents with two simulated cameras each"
rig="cameras=4;rate=50;duration=3600;free_running=1;clock_samples=1"
start_on camera-pc-1 rigcal-agent --source "sim:camera=0;$rig" --source "sim:camera=1;$rig"
start_on camera-pc-2 rigcal-agent --source "sim:camera=2;$rig" --source "sim:camera=3;$rig"
await "both agents connect" both_are_connected
type_on server-pc rigcal agent list

stage "A wave of $((3 * phase)) s, and the network fails in the middle"
type_on server-pc rigcal session create --target wand:0,0.13,0.39 --id wave --start | sed -n 1,2p
sleep "$phase"
case $fault in
  cut)
    echo "switch\$ ip link set camera-pc-2 down"
    ip link set camera-pc-2 down
    ;;
  one-way) type_on camera-pc-2 iptables -A INPUT -s 192.168.77.10 -j DROP ;;
  loss)
    for chain in INPUT OUTPUT; do
      type_on camera-pc-2 iptables -A "$chain" -m statistic --mode random --probability 0.02 -j DROP
    done
    ;;
esac
sleep "$phase"
# While the network fails the session is not verified; what waits where is named.
type_on server-pc rigcal session verify wave || test $? -eq 5
case $fault in
  cut)
    echo "switch\$ ip link set camera-pc-2 up"
    ip link set camera-pc-2 up
    ;;
  *) type_on camera-pc-2 iptables -F ;;
esac
sleep "$phase"
type_on server-pc rigcal session stop wave --drain-timeout 60 --wait
echo "camera-pc-2, messages of the agent:"
show_log camera-pc-2

stage "Nothing is lost"
type_on server-pc rigcal session verify wave

stage "The rig, calibrated (each camera's clock counts from an origin of its own)"
type_on server-pc rigcal calibrate wave --wait
