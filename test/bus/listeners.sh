# Sourced by the live tests: waits, a minute at most, until so many processes of this network namespace listen to the bus, however slowly they start.
#   await_listeners COUNT
await_listeners() {
  command -v ss >/dev/null || { sleep 5; return; }
  for _ in $(seq 600); do
    [[ $(ss -Hlunp 'sport = :7667' | grep -o 'pid=[0-9]*' | sort -u | wc -l) -ge $1 ]] && return
    sleep 0.1
  done
  echo "after a minute not $1 processes listen to the bus:"; ss -lunp
  exit 1
}
