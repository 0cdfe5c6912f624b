#!/usr/bin/env bash
# The units as scripts/install-services lays them out: systemd itself reads them without a complaint, and complains of a broken one.
#   units.sh BIN
set -euo pipefail
bin=$(realpath "$1")
command -v systemd-analyze >/dev/null || { echo "skipped: no systemd-analyze"; exit 0; }
cd "$(dirname "$0")/../.."
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
ROADFIX_BIN=$bin DESTDIR=$folder scripts/install-services configs/demo
for file in etc/sysctl.d/60-roadfix.conf etc/systemd/journald.conf.d/60-roadfix.conf etc/roadfix/environment etc/roadfix/vehicle/run.yaml \
  opt/roadfix/bin/recorder opt/roadfix/bin/gnss_ins_ekf opt/roadfix/bin/imm_fusion; do
  [[ -f $folder/$file ]] || { echo "not installed: $file"; exit 1; }
done
grep -q '^ROADFIX_BUS=udpm://239.255.76.67:7667?ttl=0$' "$folder/etc/roadfix/environment"
# Where the units' programs are looked for: this folder takes the root's place.
verify() {
  local units=$folder/units unit
  rm -rf "$units"; mkdir "$units"
  for unit in "$folder"/etc/systemd/system/*; do
    sed -e "s#/opt/roadfix/bin#$folder/opt/roadfix/bin#; s#/usr/sbin/ip#$(command -v ip)#; s#^EnvironmentFile=/#EnvironmentFile=$folder/#" "$unit" >"$units/$(basename "$unit")"
  done
  cp "$units/roadfix@.service" "$units/roadfix@recorder.service"
  mkdir "$units/roadfix@recorder.service.d"; cp configs/systemd/realtime.conf "$units/roadfix@recorder.service.d/"
  systemd-analyze verify --man=no "$units/roadfix@recorder.service" "$units/roadfix-multicast.service" "$units/roadfix.target" 2>&1 | grep -F -e roadfix -e "$folder" || true
}
complaints=$(verify)
[[ -z $complaints ]] || { echo "systemd complains:"; echo "$complaints"; exit 1; }
sed -i 's/^WatchdogSec=30/WatchdogSec=soon/' "$folder/etc/systemd/system/roadfix@.service"
[[ -n $(verify) ]] || { echo "a broken unit was not found out"; exit 1; }
# The sysctl file: every line is a key that this kernel has.
while read -r key _; do
  [[ -e /proc/sys/${key//./\/} ]] || { echo "no such sysctl: $key"; exit 1; }
done < <(grep -E '^[a-z]' configs/systemd/60-roadfix-sysctl.conf)
echo "units verified"
