#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Tries the packages of deploy/package.sh in a bare Debian that boots in a container: installs them, looks whether
# the services run, calibrates a simulated rig, upgrades, removes and purges. Needs root.
#   deploy/try-release.sh bookworm|trixie [FOLDER]     FOLDER with the packages (default: build/packages)
# Packages are for the Debian that they were built on: those of Debian 12 cannot be installed on 13.
# The steps are deploy/try-release-steps.sh; nothing of it is left running, and what it does is in build/try-release.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
suite=${1:?usage: deploy/try-release.sh bookworm|trixie [FOLDER]}
packages=${2:-$root/build/packages}
work=$root/build/try-release
debian=$work/$suite

say() { echo "try-release: $*" >&2; }
fail() {
  say "$*"
  exit 1
}
[ "$(id -u)" = 0 ] || fail "root is needed for a container; run it with sudo"
ls "$packages"/rigcal-server_*.deb >/dev/null 2>&1 || fail "no packages in $packages; make them with deploy/package.sh"
for program in mmdebstrap systemd-nspawn; do
  command -v $program >/dev/null || apt-get install -qq -y --no-install-recommends mmdebstrap systemd-container >&2
done

# A bare system with nothing but systemd, kept for the next time.
mkdir -p "$work"
if [ ! -f "$debian.tar" ]; then
  say "making a bare Debian $suite ..."
  mmdebstrap --quiet --variant=minbase --include=systemd-sysv "$suite" "$work/new.tar" \
    ${RIGCAL_DEBIAN_MIRROR:+"$RIGCAL_DEBIAN_MIRROR"}
  mv "$work/new.tar" "$debian.tar"
fi
rm -rf "$debian"
mkdir -p "$debian"
tar -xf "$debian.tar" -C "$debian"

# The packages, and the same once more with a higher version.
mkdir -p "$debian/opt/first" "$debian/opt/second"
cp "$packages"/rigcal*.deb "$debian/opt/first"
for package in "$packages"/rigcal*.deb; do
  rm -rf "$work/repacked"
  dpkg-deb --raw-extract "$package" "$work/repacked"
  sed -i 's/^Version: .*/&+later/; s/\(rigcal-[a-z]* (= [^)]*\|rigcal (= [^)]*\))/\1+later)/g' "$work/repacked/DEBIAN/control"
  dpkg-deb -Zgzip -z1 --root-owner-group --build "$work/repacked" "$debian/opt/second" >/dev/null
done
rm -rf "$work/repacked"

# apt of the container downloads as apt of this PC does; the container itself has no network.
cp /etc/resolv.conf "$debian/etc/resolv.conf"
apt-config dump Acquire | grep -E '^Acquire::(Check-|https?::Proxy|https?::[^ ]*::Proxy)' \
  >"$debian/etc/apt/apt.conf.d/90of-this-pc" || true
began=$SECONDS
chroot "$debian" sh -c 'apt-get -qq update && apt-get -qq -y install --no-install-recommends --download-only /opt/first/*.deb' \
  >"$work/apt.log" 2>&1 \
  || { tail -n 20 "$work/apt.log" >&2; fail "apt cannot install the packages on $suite; were they built on it?"; }
say "apt downloaded in $((SECONDS - began)) s"

cp "$root/deploy/try-release-steps.sh" "$debian/opt/steps.sh"
cat >"$debian/etc/systemd/system/try-release.service" <<'UNIT'
[Unit]
Description=Steps of try-release
After=multi-user.target
SuccessAction=exit
FailureAction=exit

[Service]
Type=oneshot
Environment=DEBIAN_FRONTEND=noninteractive HOME=/root
StandardOutput=file:/opt/steps.log
StandardError=inherit
ExecStart=/bin/bash /opt/steps.sh
ExecStopPost=/bin/sh -c 'journalctl -u rigcal-server -u rigcal-agent --no-pager >/opt/journal.log'
UNIT
mkdir -p "$debian/etc/systemd/system/multi-user.target.wants"
ln -sf ../try-release.service "$debian/etc/systemd/system/multi-user.target.wants/"
timeout 1800 systemd-nspawn --quiet --boot --directory="$debian" --private-network --register=no --keep-unit \
  >"$work/boot.log" 2>&1 || true
cat "$debian/opt/steps.log"
tail -n 1 "$debian/opt/steps.log" | grep -qx 'all steps are done' \
  || fail "failed on $suite; see $debian/opt/steps.log, journal.log beside it, and $work/boot.log"
say "$suite: all steps are done"
