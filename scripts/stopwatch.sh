# Sourced by scripts/demo and scripts/test: what the time went to. `spend PART` ends a part; `spent` prints all of them.
stopwatch_begin=$(date +%s.%N)
stopwatch_last=$stopwatch_begin
stopwatch_parts=()
spend() {
  local now
  now=$(date +%s.%N)
  stopwatch_parts+=("$1 $(awk -v a="$stopwatch_last" -v b="$now" 'BEGIN { printf "%.1f", (b - a) / 60 }') min")
  stopwatch_last=$now
}
spent() {
  local IFS=, all
  all="${stopwatch_parts[*]}"
  echo "$1: $(awk -v a="$stopwatch_begin" -v b="$stopwatch_last" 'BEGIN { printf "%.1f", (b - a) / 60 }') min: ${all//,/, }"
}
