#!/bin/sh
# Makes acqd/report/assets/three.min.js of three.js from npm, in the versions of package-lock.json. Needs node and npm.
#   sh tools/three/build.sh [--update]      --update: after a change of package.json
# Then `make sbom`, or python -m tools.vendored, writes the version and the hash into acqd.cdx.json.
set -eu
cd "$(dirname "$0")"
assets=../../acqd/report/assets
[ "${1:-}" = --update ] && npm install --package-lock-only --ignore-scripts --no-audit --no-fund
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
cp package.json package-lock.json entry.js "$place"
(cd "$place" && npm ci --ignore-scripts --no-audit --no-fund --silent)
version=$(sed -n 's/.*"three": "\(.*\)".*/\1/p' package.json)
"$place"/node_modules/.bin/esbuild "$place"/entry.js --bundle --minify --format=iife --global-name=THREE \
    --legal-comments=none --banner:js="/*! three.js $version, MIT, https://github.com/mrdoob/three.js; parts, see tools/three */" \
    --outfile="$assets"/three.min.js
cp "$place"/node_modules/three/LICENSE "$assets"/three.LICENSE
