#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes Debian packages of what is committed: rigcal-server, rigcal-agent, rigcal, rigcal-doc, python3-rigcal.
#   deploy/package.sh [--version VERSION] [FOLDER]     FOLDER for the packages (default: build/packages)
# Then, on any PC with the same Debian: sudo apt install ./*rigcal*.deb
#
# Installs what is missing with apt, and builds everything once more: half an hour with two cores, without
# network but for apt and npm. The version is that of deploy/debian/changelog with the time of the last commit, or that
# version alone where a tag names it. One commit gives the same packages, byte for byte, on PCs with the same
# packages of Debian.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
began=$SECONDS

version=
if [ "${1:-}" = --version ]; then
  version=${2:?--version needs a version, such as 0.1.0+lab1}
  shift 2
fi
folder=$(realpath -m -- "${1:-$root/build/packages}")
say() { echo "package: $*" >&2; }

"$root/deploy/install-deps.sh" --packages
cd "$root"
[ -z "$(git status --porcelain)" ] || say "what is not committed is not packaged"
commit=$(git rev-parse --short=8 HEAD)
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct HEAD)
export SOURCE_DATE_EPOCH
released=$(dpkg-parsechangelog -l deploy/debian/changelog --show-field Version)
if [ -n "$version" ]; then
  :
elif git tag --points-at HEAD | grep -qxF "v$released"; then
  version=$released
else
  # Before the release of that number, and later commits after earlier ones.
  version=$released~git$(date -u -d "@$SOURCE_DATE_EPOCH" +%Y%m%d.%H%M%S).$commit
fi
dpkg --validate-version "$version"

work=$root/build/package
rm -rf "$work"
mkdir -p "$work/source" "$folder"
git archive HEAD | tar -x -C "$work/source"
cd "$work/source"
cp -rL deploy/debian debian  # where Debian's tools look for it
if [ "$version" != "$released" ]; then
  {
    printf 'rigcal (%s) UNRELEASED; urgency=medium\n\n  * Commit %s.\n\n -- %s  %s\n\n' "$version" "$commit" \
      "$(dpkg-parsechangelog --show-field Maintainer)" "$(date -u -R -d "@$SOURCE_DATE_EPOCH")"
    cat debian/changelog
  } >"$work/changelog"
  mv "$work/changelog" debian/changelog
fi

# debhelper gives the build a home of its own; npm keeps the settings and the cache of this user.
npm_config_userconfig=$(npm config get userconfig)
npm_config_cache=$(npm config get cache)
export npm_config_userconfig npm_config_cache
say "rigcal $version; the log is $work/build.log"
# -d: install-deps.sh has installed what is needed, and takes node from elsewhere as well.
if ! DEB_BUILD_OPTIONS="parallel=$(nproc) ${DEB_BUILD_OPTIONS:-}" \
  dpkg-buildpackage --build=binary --no-sign --no-check-builddeps >"$work/build.log" 2>&1; then
  tail -n 30 "$work/build.log" >&2
  say "the build has failed; the end of its log is above"
  exit 1
fi
rm -f "$folder"/*rigcal*.deb
mv "$work"/*.deb "$folder"
cd "$folder"
du -ch --apparent-size -- *.deb
say "this took $(((SECONDS - began) / 60)) min $(((SECONDS - began) % 60)) s; install with: sudo apt install $folder/*.deb"
