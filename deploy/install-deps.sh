#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the packages of Debian 12 or 13 that rigcal needs. Does nothing if all of them are installed.
#   deploy/install-deps.sh            packages for building, testing and running
#   deploy/install-deps.sh --list     only prints the missing packages
#   deploy/install-deps.sh --packages also what makes Debian packages of rigcal (deploy/package.sh)
#   deploy/install-deps.sh --agent    only what rigcal-agent needs on a PC with cameras, for programs
#                                     that were built on another PC with the same release of Debian
# --agent and --list go together.
set -euo pipefail

list=
for_agent=
for_packages=
for argument in "$@"; do
  case $argument in
    --list) list=1 ;;
    --agent) for_agent=1 ;;
    --packages) for_packages=1 ;;
    *)
      echo "install-deps: unknown argument $argument; there are --list, --agent, --packages" >&2
      exit 2
      ;;
  esac
done

packages=(
  # compiler and build
  g++ cmake ninja-build ccache pkg-config git
  # gRPC and protobuf
  libgrpc++-dev protobuf-compiler-grpc libprotobuf-dev protobuf-compiler libabsl-dev
  # geometry and solving
  libeigen3-dev libceres-dev libopencv-dev
  # cameras (libaravis-dev does not depend on libusb's headers, but needs them)
  libaravis-dev libusb-1.0-0-dev
  # finding servers by mDNS (optional; to run: avahi-daemon)
  libavahi-client-dev libavahi-common-dev
  # services of systemd
  libsystemd-dev
  # event files
  libhdf5-dev
  # network namespaces of the demos, and their faults
  iproute2 iptables
  # store, configuration, command line, logging
  libsqlitecpp-dev libsqlite3-dev libpq-dev zlib1g-dev libarchive-dev libssl-dev libboost-dev prometheus-cpp-dev
  libtomlplusplus-dev libyaml-cpp-dev libxml2-dev libcli11-dev nlohmann-json3-dev
  libspdlog-dev
  # firmware of the wand, and what runs it in tests
  gcc-avr avr-libc libsimavr-dev
  # the Python package: to run, and to make a wheel of it
  python3 python3-numpy python3-grpcio python3-protobuf python3-pip python3-setuptools python3-wheel
  # the documentation as a site
  mkdocs
  # tests
  libgtest-dev libgmock-dev libbenchmark-dev librapidcheck-dev postgresql pgbouncer faketime python3-opencv python3-matplotlib python3-yaml
)

# The dashboard and its tests, unless these programs are here from elsewhere.
command -v node >/dev/null && command -v npm >/dev/null || packages+=(nodejs npm)
command -v chromium >/dev/null || packages+=(chromium)

[ -z "$for_packages" ] || packages+=(debhelper dh-python dpkg-dev)

# Libraries that the built agent is linked with; their own libraries come with them. A library's package has its
# version in its name, so each Debian has its own.
if [ -n "$for_agent" ]; then
  debian=$(. /etc/os-release && echo "${ID:-}-${VERSION_ID:-}")
  case $debian in
    debian-12) opencv=406 packages=(
      libgrpc++1.51 libgrpc29 libprotobuf32 libabsl20220623 libssl3
      libglib2.0-0 libhdf5-103-1 libtomlplusplus3 libyaml-cpp0.7 libspdlog1.10 libfmt9) ;;
    debian-13) opencv=410 packages=(
      libgrpc++1.51t64 libgrpc29t64 libprotobuf32t64 libabsl20240722 libssl3t64
      libglib2.0-0t64 libhdf5-310 libtomlplusplus3t64 libyaml-cpp0.8 libspdlog1.15 libfmt10 libopencv-objdetect410) ;;
    *)
      echo "install-deps: --agent knows the libraries of Debian 12 and 13, not of $debian; install rigcal-agent's package" >&2
      exit 1
      ;;
  esac
  for part in calib3d contrib core features2d imgcodecs imgproc video videoio; do packages+=("libopencv-$part$opencv"); done
  packages+=(libaravis-0.8-0 libavahi-client3 libavahi-common3 libsystemd0 libxml2 zlib1g libstdc++6 libgcc-s1 libc6)
fi

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$status" = installed ] || missing+=("$package")
done

if [ -n "$list" ]; then
  [ ${#missing[@]} -eq 0 ] || printf '%s\n' "${missing[@]}"
  exit 0
fi
[ ${#missing[@]} -eq 0 ] && exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "install-deps: root or sudo is needed to install the missing packages: ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "install-deps: installing ${missing[*]}" >&2
"${as_root[@]}" apt-get update -qq
DEBIAN_FRONTEND=noninteractive "${as_root[@]}" apt-get install -y -qq --no-install-recommends \
  "${missing[@]}" >&2
