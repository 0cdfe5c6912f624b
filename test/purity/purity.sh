#!/usr/bin/env bash
# Greps ROOT for what docs/DESIGN.md (sections 3 and 5) and docs/STYLE.md (sections 4 and 8) forbid; prints each breach and fails with their number.
#   purity.sh ROOT
set -uo pipefail
cd "$1" || exit 2
order=(geometry statistics geodesy samples stream inertial vehicle wheel camera features navigation slam fusion papers integrity health evaluation simulation)
estimators=' wheel slam navigation fusion '
breaches=0

# report WHY: counts and prints the lines on standard input, comments left out.
report() {
  local line
  while IFS= read -r line; do
    breaches=$((breaches + 1))
    printf '%s: %s\n' "$1" "$line"
  done < <(grep -vE '^[^:]+:[0-9]+: *//')
}

seen=' '
for library in "${order[@]}"; do
  seen+="$library "
  [[ -d lib/$library ]] || continue
  report 'an estimator library knows no bus, clock, file or environment' < <(grep -rnE --include='*.h' --include='*.cpp' \
    -e '#include [<"](lcm/|roadfix/|yaml-cpp|chrono|ctime|time\.h|fstream|filesystem|iostream|cstdio|unistd\.h|sys/)' \
    -e 'std::(cout|cerr|getenv|exit|chrono|random_device|filesystem|ofstream|ifstream|rand)\b' \
    -e '^ *static [^(]*=[^=]*;' -e '\bassert\(' lib/"$library" | grep -vE 'static (constexpr|const) ')
  while IFS=: read -r file number include; do
    used=${include#*\"}; used=${used%%/*}
    if [[ $seen != *" $used "* ]]; then
      report "lib/$library may use only what stands above it" <<<"$file:$number:$include"
    elif [[ $used != "$library" && $estimators == *" $used "* && $estimators == *" $library "* ]]; then
      report 'no estimator knows another' <<<"$file:$number:$include"
    fi
  done < <(grep -rnE --include='*.h' --include='*.cpp' '#include "[a-z_]+/' lib/"$library")
done

report 'tests draw no unseeded random numbers' < <(grep -rnE --include='*.h' --include='*.cpp' \
  -e 'std::random_device|\bs?rand\(' -e '(Matrix|Vector|Quaternion)[0-9X]*d?(<[^>]*>)?::(Unit)?Random\(' test 2>/dev/null | grep -v '^test/purity/')

# CMake splits lists at semicolons: CTest would call the program with half of the name, which no test has, and that passes.
report 'a name of a test has no semicolon' < <(grep -rnE -A1 --include='*.cpp' 'TEST_CASE\(' test 2>/dev/null | grep -v '^test/purity/' |
  sed -E 's/^([^:]+\.cpp)-([0-9]+)-/\1:\2:/' | grep -E '^[^:]+:[0-9]+:(TEST_CASE\(| +)"[^"]*;[^"]*"')

# Two types of one qualified name break the one-definition rule as soon as a program links both, and no linker says so.
report 'one name, one type' < <(find lib processes test \( -name '*.h' -o -name '*.cpp' \) -not -path 'test/purity/*' 2>/dev/null | sort | xargs awk '
  FNR == 1 { depth = 0 }
  /^namespace .*\{/ { space[++depth] = $2 == "{" ? "(in " FILENAME ")" : $2; next }
  /^}  \/\/ namespace/ { if (depth > 0) depth--; next }
  /^(struct|class|enum|union) [^;]*\{/ {
    name = $2 == "class" ? $3 : $2
    for (i = depth; i > 0; i--) name = space[i] "::" name
    if (name in first) print FILENAME ":" FNR ": " name ", also in " first[name]; else first[name] = FILENAME
  }')

# Equations are numbered (X.section.n), X the letter of the library, in order; what the code cites is in its MODEL.md.
numbering=(inertial:I vehicle:V navigation:N wheel:W slam:S simulation:D camera:K health:H evaluation:E features:T integrity:P)
for entry in "${numbering[@]}"; do
  library=${entry%:*} letter=${entry#*:}
  [[ -f lib/$library/MODEL.md ]] || continue
  mapfile -t models < <(find "lib/$library" -name MODEL.md | sort)  # a part of it may lie in a folder of its own, by whole sections
  for model in "${models[@]}"; do
    # A number at the end of a line defines an equation; anywhere else it cites one.
    report 'equations are numbered in order, by section' < <(awk -v file="$model" -v letter="$letter" '
      /^## [0-9]+\./ { section = $2 + 0; last = 0; next }
      match($0, "\\(" letter "\\.[0-9]+\\.[0-9]+\\)$") && /^    / {
        split(substr($0, RSTART + 1, RLENGTH - 2), part, ".")
        if (part[2] != section || part[3] != last + 1) print file ":" FNR ":" $0
        last = part[3]
      }' "$model")
  done
  report 'a cited equation is in MODEL.md' < <(grep -rnoE --include='*.h' --include='*.cpp' --include='*.md' "\\($letter\\.[0-9]+\\.[0-9]+\\)" \
    lib test/unit 2>/dev/null | while IFS=: read -r file number cited; do
      grep -qE "^    .*\\(${cited:1:-1}\\)\$" "${models[@]}" || printf '%s:%s:%s\n' "$file" "$number" "$cited"
    done)
done

if [[ $breaches -gt 0 ]]; then echo "$breaches breaches"; exit 1; fi
echo "pure"
