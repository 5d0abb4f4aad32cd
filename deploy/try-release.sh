#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Tries the packages of deploy/package.sh in a bare Debian that boots in a container: installs them, looks whether
# the services run, records and calibrates simulated cameras, upgrades in the middle of a recording, removes and
# purges. Needs root.
#   deploy/try-release.sh [--build] [--tests] bookworm|trixie [FOLDER]
#     FOLDER    the packages (default: build/packages; with --build: build/packages-SUITE)
#     --build   first builds the packages of what is committed, in a root of that Debian with what install-deps.sh
#               installs; packages are for the Debian that they were built on
#     --tests   builds the tests there, too, and runs all of them
# The steps are deploy/try-release-steps.sh; nothing of it is left running, and what it does is in build/try-release.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
usage="usage: deploy/try-release.sh [--build] [--tests] bookworm|trixie [FOLDER]"
build="" tests="" suite="" packages=""
for argument in "$@"; do
  case $argument in
    --build) build=1 ;;
    --tests) tests=1 ;;
    -*) echo "$usage" >&2; exit 2 ;;
    *) if [ -z "$suite" ]; then suite=$argument; else packages=$argument; fi ;;
  esac
done
[ -n "$suite" ] || { echo "$usage" >&2; exit 2; }
work=$root/build/try-release
if [ -n "$build" ]; then : "${packages:=$root/build/packages-$suite}"; else : "${packages:=$root/build/packages}"; fi
debian=$work/$suite

say() { echo "try-release: $*" >&2; }
fail() {
  say "$*"
  exit 1
}
[ "$(id -u)" = 0 ] || fail "root is needed for a container; run it with sudo"
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

# apt and npm of a root download as those of this PC do.
download_as_here() {
  cp /etc/resolv.conf "$1/etc/resolv.conf"
  apt-config dump Acquire | grep -E '^Acquire::(Check-|https?::Proxy|https?::[^ ]*::Proxy)' \
    >"$1/etc/apt/apt.conf.d/90of-this-pc" || true
  [ -z "${NODE_EXTRA_CA_CERTS:-}" ] || cp "$NODE_EXTRA_CA_CERTS" "$1/opt/certificates.pem"
}

# Builds and tests in a root of their own, which is kept for the next time.
if [ -n "$build$tests" ]; then
  builder=$work/$suite-build
  if [ ! -d "$builder/src" ]; then
    mkdir -p "$builder"
    tar -xf "$debian.tar" -C "$builder"
    mkdir -p "$builder/src"
  fi
  download_as_here "$builder"
  # A namespace of mounts: none is left behind, however this ends.
  in_builder() {
    unshare --mount sh -c 'root=$1 && shift && for folder in proc dev sys; do mount --rbind /$folder "$root/$folder"; done &&
      exec chroot "$root" env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive \
      NODE_EXTRA_CA_CERTS=/opt/certificates.pem npm_config_cafile="$(test ! -f "$root/opt/certificates.pem" || echo /opt/certificates.pem)" \
      OPENBLAS_CORETYPE="${OPENBLAS_CORETYPE:-}" "$@"' sh "$builder" "$@"
  }
  in_builder sh -c 'apt-get -qq update && apt-get -qq -y install --no-install-recommends ca-certificates git' \
    >"$work/apt.log" 2>&1 || { tail -n 20 "$work/apt.log" >&2; fail "apt of $suite has failed"; }
  git -C "$root" bundle create --quiet "$builder/opt/rigcal.bundle" HEAD
  in_builder sh -c 'cd /src && { [ -d .git ] || git init -q; } && git fetch -q /opt/rigcal.bundle HEAD &&
    git -c advice.detachedHead=false checkout -q --force FETCH_HEAD'
fi
if [ -n "$tests" ]; then
  say "building and testing on $suite; the log is $work/tests-$suite.log"
  in_builder bash -c 'cd /src && tests/run.sh' >"$work/tests-$suite.log" 2>&1 || {
    tail -n 40 "$work/tests-$suite.log" >&2
    fail "tests have failed on $suite"
  }
  grep 'tests passed' "$work/tests-$suite.log"
fi
if [ -n "$build" ]; then
  say "building packages on $suite; the log is $work/package-$suite.log"
  in_builder bash -c 'cd /src && deploy/package.sh' >"$work/package-$suite.log" 2>&1 || {
    tail -n 40 "$work/package-$suite.log" >&2
    fail "the packages cannot be built on $suite"
  }
  tail -n 8 "$work/package-$suite.log" >&2
  mkdir -p "$packages"
  rm -f "$packages"/*rigcal*.deb
  cp "$builder"/src/build/packages/*.deb "$packages"
fi
ls "$packages"/rigcal-server_*.deb >/dev/null 2>&1 || fail "no packages in $packages; make them with deploy/package.sh"

rm -rf "$debian"
mkdir -p "$debian"
tar -xf "$debian.tar" -C "$debian"

# The packages, and the same once more with a higher version.
mkdir -p "$debian/opt/first" "$debian/opt/second"
cp "$packages"/*rigcal*.deb "$debian/opt/first"
for package in "$packages"/*rigcal*.deb; do
  rm -rf "$work/repacked"
  dpkg-deb --raw-extract "$package" "$work/repacked"
  sed -i 's/^Version: .*/&+later/; s/\(rigcal-[a-z]* (= [^)]*\|rigcal (= [^)]*\))/\1+later)/g' "$work/repacked/DEBIAN/control"
  dpkg-deb -Zgzip -z1 --root-owner-group --build "$work/repacked" "$debian/opt/second" >/dev/null
done
rm -rf "$work/repacked"

# The container itself has no network.
download_as_here "$debian"
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
