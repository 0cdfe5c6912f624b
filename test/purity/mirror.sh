#!/usr/bin/env bash
# Whether tests are where one looks for them: test/unit/X tests lib/X, test/unit/processes/X tests processes/X, every library and process has such a
# folder, and test/bench holds benchmarks alone. Prints each breach and fails with their number.
#   mirror.sh ROOT
set -uo pipefail
cd "$1" || exit 2
breaches=0
report() { echo "$1"; breaches=$((breaches + 1)); }
folders() { [[ ! -d $1 ]] || find "$1" -mindepth 1 "${@:2}" -type d | sort; }

while read -r folder; do
  case ${folder#test/unit/} in
    processes) continue ;;
    processes/*) tested=${folder#test/unit/} ;;
    *) tested=lib/${folder#test/unit/} ;;
  esac
  [[ -d $tested ]] || report "$folder: there is no $tested that it could test"
done < <(folders test/unit)

while read -r folder; do
  [[ -n $(find "$folder" -name '*.cpp' -print -quit) ]] || continue  # headers alone
  tests=test/unit/${folder#lib/}
  [[ -n $(find "$tests" -name '*_test.cpp' -print -quit 2>/dev/null) ]] || report "$folder: no test in $tests"
done < <(folders lib -maxdepth 1; folders processes -maxdepth 1)

while read -r file; do
  report "$file: a test belongs into the folder of what it tests"
done < <(find test/unit -maxdepth 1 -name '*_test.cpp' 2>/dev/null)
while read -r file; do
  grep -q '^ *BENCHMARK' "$file" || report "$file: no benchmark; programs go to tools/experiments"
done < <(find test/bench -name '*.cpp' 2>/dev/null | sort)

if [[ $breaches -gt 0 ]]; then echo "$breaches breaches"; exit 1; fi
echo "mirrored"
