#!/usr/bin/env bash
# Reads the machine code of programs, archives and objects, and names every instruction that makers of processors implement differently: the estimates
# of one over x and of one over the root of x. What we compute must not contain one (docs/DESIGN.md, "Same bits: where"). Its last line counts them.
#   instructions.sh FILE...
set -euo pipefail
command -v objdump >/dev/null || { echo "skipped: objdump (package binutils) is not here"; exit 0; }
[[ $# -gt 0 ]] || { echo "instructions: no files given" >&2; exit 2; }
found=0 read=0
for file in "$@"; do
  [[ -f $file ]] || { echo "instructions: $file is not there" >&2; exit 2; }
  code=$(mktemp)
  trap 'rm -f "$code"' EXIT
  objdump -d --no-show-raw-insn "$file" >"$code"
  read=$((read + $(grep -cE '^ +[0-9a-f]+:' "$code" || true)))
  while IFS= read -r line; do
    echo "$file: $line"
    found=$((found + 1))
  done < <(awk '/^[0-9a-f]+ <.*>:$/ { name = $2 } /\t(v?rcp(ps|ss|14|28|ph|sh)|v?rsqrt(ps|ss|14|28|ph|sh))/ { print name $0 }' "$code")
  rm -f "$code"
done
[[ $read -gt 0 ]] || { echo "instructions: no machine code in $*" >&2; exit 2; }
echo "$found estimates among $read instructions"
[[ $found -eq 0 ]]
