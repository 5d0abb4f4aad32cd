#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# What deploy/try-release.sh does in a bare Debian with the packages in /opt/first and, of a higher version, in
# /opt/second. It deletes data of rigcal: not for a PC that is used.
set -euo pipefail
trap 'echo "failed in line $LINENO: $BASH_COMMAND"' ERR
[ -d /opt/first ] && [ -d /opt/second ]

step() { printf '\n== %s\n' "$*"; }
quietly() { "$@" >/opt/apt.log 2>&1 || { cat /opt/apt.log; return 1; }; }
# An observation of systemd that must hold within a minute.
expect() {
  local wanted=$1 seen="" i
  shift
  for i in $(seq 120); do
    seen=$("$@" 2>&1) || true
    [ "$seen" != "$wanted" ] || { echo "$* -> $seen"; return 0; }
    sleep 0.5
  done
  echo "$* -> $seen, not $wanted"
  return 1
}
value() { systemctl show --property="$2" --value "$1"; }

step "install"
began=$SECONDS
quietly apt-get install -y --no-install-recommends /opt/first/*.deb
echo "apt install: $((SECONDS - began)) s"
for program in rigcal rigcal-agent rigcal-server rigcal-worker; do $program --version; done
du -ch --apparent-size /usr/bin/rigcal* | tail -n 1

step "the server runs"
expect active systemctl is-active rigcal-server
expect enabled systemctl is-enabled rigcal-server
expect rigcal value rigcal-server User
value rigcal-server StatusText
rigcal doctor || true
rigcal session create --target wand:0,0.13,0.39 --id kept
# Its own user finds the socket file of the service.
runuser -u rigcal -- rigcal session list | grep kept

step "the agent starts without a camera"
expect active systemctl is-active rigcal-agent
journalctl -u rigcal-agent --no-pager -o cat | grep 'no camera takes part yet'
printf '[[camera]]\nsource = "sim:camera=0;cameras=4"\n' >>/etc/rigcal/agent.toml
systemctl restart rigcal-agent
expect active systemctl is-active rigcal-agent
value rigcal-agent StatusText
sleep 2
rigcal agent list | grep 'connected.*sim:camera=0'

step "calibrate a simulated rig"
began=$SECONDS
rigcal local --simulate "cameras=4;duration=20" --target wand:0,0.13,0.39
echo "rigcal local: $((SECONDS - began)) s"

step "a server that hangs is started again"
mkdir -p /run/systemd/system/rigcal-server.service.d
printf '[Service]\nWatchdogSec=2\n' >/run/systemd/system/rigcal-server.service.d/short.conf
systemctl daemon-reload
systemctl restart rigcal-server
sleep 5
expect 0 value rigcal-server NRestarts
systemctl kill --kill-whom=main --signal=STOP rigcal-server
expect 1 value rigcal-server NRestarts
expect active systemctl is-active rigcal-server
rm -r /run/systemd/system/rigcal-server.service.d
systemctl daemon-reload

step "units"
systemd-analyze verify --man=no rigcal-server.service rigcal-agent.service
systemd-analyze security --no-pager --threshold=20 rigcal-server.service | tail -n 1
systemd-analyze security --no-pager --threshold=35 rigcal-agent.service | tail -n 1

step "upgrade in the middle of a recording"
printf '[[camera]]\nsource = "sim:camera=%s;cameras=4"\n' 1 2 3 >>/etc/rigcal/agent.toml
systemctl restart rigcal-agent
expect 4 sh -c "rigcal agent list | grep -c 'sim:camera='"
rigcal session create --target wand:0,0.13,0.39 --id wave --start
sleep 10
began=$SECONDS
quietly apt-get install -y --no-install-recommends /opt/second/*.deb
echo "apt upgrade: $((SECONDS - began)) s"
dpkg-query -W '*rigcal*'
expect active systemctl is-active rigcal-server
expect active systemctl is-active rigcal-agent
expect 4 sh -c "rigcal agent list | grep -c 'sim:camera='"
sleep 15
rigcal session stop wave --wait
rigcal session verify wave
rigcal session get wave
rigcal calibrate wave --wait
rigcal session list | grep kept

step "an older version is refused, and nothing is changed"
installed=$(dpkg-query -W -f '${Version}' rigcal-server)
if apt-get install -y --allow-downgrades --no-install-recommends /opt/first/*.deb >/opt/apt.log 2>&1; then
  echo "the downgrade was not refused"
  false
fi
grep 'may not read its data' /opt/apt.log
[ "$(dpkg-query -W -f '${Version}' rigcal-server)" = "$installed" ]
quietly apt-get install -y --no-install-recommends /opt/second/*.deb # the packages that apt took before that one
expect active systemctl is-active rigcal-server

step "remove"
quietly apt-get remove -y '*rigcal*'
expect inactive systemctl is-active rigcal-server
test ! -e /usr/bin/rigcal-server
ls /etc/rigcal
test -f /var/lib/rigcal/rigcal.db

step "purge keeps what cannot be made again"
apt-get purge -y '*rigcal*' 2>&1 | grep 'is kept'
test ! -e /etc/rigcal
test -f /var/lib/rigcal/rigcal.db

step "install again: it is still there"
quietly apt-get install -y --no-install-recommends /opt/first/rigcal_*.deb /opt/first/rigcal-server_*.deb
expect active systemctl is-active rigcal-server
rigcal session list | grep kept

step "purge with RIGCAL_PURGE_DATA=1"
RIGCAL_PURGE_DATA=1 quietly apt-get purge -y '*rigcal*'
test ! -e /var/lib/rigcal

echo
echo "all steps are done"
