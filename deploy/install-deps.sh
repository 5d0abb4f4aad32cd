#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what rigcal needs on Debian 12, all of it from Debian. Installs nothing when all is there.
#   deploy/install-deps.sh            what building, testing and running needs
#   deploy/install-deps.sh --list     only prints the packages that are missing
set -euo pipefail

packages=(
  # compiler and build
  g++ cmake ninja-build ccache pkg-config git
  # wire
  libgrpc++-dev protobuf-compiler-grpc libprotobuf-dev protobuf-compiler grpc-proto libabsl-dev
  # geometry and solving
  libeigen3-dev libceres-dev libopencv-dev
  # cameras (libaravis-dev forgets to ask for libusb's headers)
  libaravis-dev libusb-1.0-0-dev
  # files of event cameras
  libhdf5-dev
  # a network of its own for the GigE demo
  iproute2
  # store, configuration, command line, logging
  libsqlitecpp-dev libsqlite3-dev zlib1g-dev libssl-dev
  libtomlplusplus-dev libcli11-dev nlohmann-json3-dev libspdlog-dev
  # tests
  libgtest-dev libgmock-dev libbenchmark-dev librapidcheck-dev libboost-dev
)

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$status" = installed ] || missing+=("$package")
done

if [ "${1:-}" = --list ]; then
  [ ${#missing[@]} -eq 0 ] || printf '%s\n' "${missing[@]}"
  exit 0
fi
[ ${#missing[@]} -eq 0 ] && exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "install-deps: these packages are missing and need root to install: ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "install-deps: installing ${missing[*]}" >&2
"${as_root[@]}" apt-get update -qq
DEBIAN_FRONTEND=noninteractive "${as_root[@]}" apt-get install -y -qq --no-install-recommends \
  "${missing[@]}" >&2
