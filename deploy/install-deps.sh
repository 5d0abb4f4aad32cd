#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the Debian 12 packages that rigcal needs. Does nothing if all of them are installed.
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
  libgrpc++-dev protobuf-compiler-grpc libprotobuf-dev protobuf-compiler grpc-proto libabsl-dev
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
  libsqlitecpp-dev libsqlite3-dev zlib1g-dev libarchive-dev libssl-dev libboost-dev prometheus-cpp-dev
  libtomlplusplus-dev libyaml-cpp-dev libxml2-dev libcli11-dev nlohmann-json3-dev
  libspdlog-dev
  # firmware of the wand, and what runs it in tests
  gcc-avr avr-libc libsimavr-dev
  # the Python package: to run, and to make a wheel of it
  python3 python3-numpy python3-grpcio python3-protobuf python3-pip python3-setuptools python3-wheel
  # tests
  libgtest-dev libgmock-dev libbenchmark-dev librapidcheck-dev faketime python3-opencv python3-matplotlib
)

# The dashboard and its tests, unless these programs are here from elsewhere.
command -v node >/dev/null && command -v npm >/dev/null || packages+=(nodejs npm)
command -v chromium >/dev/null || packages+=(chromium)

[ -z "$for_packages" ] || packages+=(debhelper dpkg-dev pandoc)

# Libraries that the built agent is linked with; their own libraries come with them. A library's
# package has its version in its name, so they are those of Debian 12.
agent_packages=(
  # network
  libgrpc++1.51 libgrpc29 libprotobuf32 libabsl20220623 libssl3
  libavahi-client3 libavahi-common3 libsystemd0
  # cameras and detection
  libaravis-0.8-0 libglib2.0-0 libhdf5-103-1
  libopencv-calib3d406 libopencv-contrib406 libopencv-core406 libopencv-features2d406
  libopencv-imgcodecs406 libopencv-imgproc406 libopencv-video406 libopencv-videoio406
  # configuration, files, logging
  libtomlplusplus3 libyaml-cpp0.7 libxml2 zlib1g libspdlog1.10 libfmt9
  libstdc++6 libgcc-s1 libc6
)
[ -z "$for_agent" ] || packages=("${agent_packages[@]}")

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
