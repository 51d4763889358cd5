#!/bin/sh
# Opens pages that the command writes in headless Chromium and looks at them. Skipped without node, npm or Chromium.
#   tests/tool/browser/browser.sh LOCKSTEP FOLDER                                SPDX-License-Identifier: Apache-2.0
here=$(cd "$(dirname "$0")" && pwd)
lockstep=$1 folder=$2
skip() { echo "skipped: $1"; exit 0; }
command -v node >/dev/null && command -v npm >/dev/null || skip "there is no node or no npm (Debian: nodejs, npm)"
chromium=$(command -v chromium || command -v chromium-browser || command -v google-chrome) ||
  skip "there is no Chromium (Debian: chromium)"
"$lockstep" view --help >/dev/null || exit 1
mkdir -p "$folder" && cd "$folder" || exit 1
if ! cmp -s "$here/package-lock.json" node_modules/fetched; then
  cp "$here/package.json" "$here/package-lock.json" .
  npm ci --ignore-scripts --no-audit --no-fund --fetch-retries=1 >npm.log 2>&1 ||
    skip "npm could not fetch playwright-core: $folder/npm.log says why"
  cp package-lock.json node_modules/fetched
fi
cp "$here"/*.mjs .
node page_test.mjs "$lockstep" "$chromium" "$here/../../models"
