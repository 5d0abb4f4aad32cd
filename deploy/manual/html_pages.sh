#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes an HTML page beside each Markdown file of a folder, with pandoc; links among them lead to the pages.
#   deploy/manual/html_pages.sh FOLDER
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
[ $# -eq 1 ] || { echo "usage: html_pages.sh FOLDER" >&2; exit 2; }

find "$1" -name '*.md' -print0 | sort -z | while IFS= read -r -d '' page; do
  title=$(sed -n 's/^# //p;/^# /q' "$page")
  pandoc --from gfm --to html5 --standalone --lua-filter "$here/page_links.lua" \
    --metadata "pagetitle=${title:-$(basename "$page" .md)}" --output "${page%.md}.html" "$page"
done
