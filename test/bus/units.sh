#!/usr/bin/env bash
# The units as scripts/install-services lays them out: systemd itself reads them without a complaint, and complains of a broken one; and the
# command without DESTDIR, on a machine whose /etc and /opt are copies: what it enables, and what it takes back for another vehicle.
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
own=etc/systemd/system/roadfix@monitor.service.d/run.conf
grep -q -- '^ExecStart=/opt/roadfix/bin/%i --config ${ROADFIX_VEHICLE} --bus ${ROADFIX_BUS} "--plain"$' "$folder/$own" ||
  { echo "run.yaml's arguments did not reach the unit"; exit 1; }
grep -q '^ROADFIX_BUS=udpm://239.255.76.67:7667?ttl=0$' "$folder/etc/roadfix/environment"
# Where the units' programs are looked for: this folder takes the root's place.
verify() {
  local units=$folder/units unit
  rm -rf "$units"; mkdir -p "$units/roadfix@monitor.service.d"
  for unit in "$folder"/etc/systemd/system/* "$folder/$own"; do
    [[ -f $unit ]] || continue
    sed -e "s#/opt/roadfix/bin#$folder/opt/roadfix/bin#; s#/usr/sbin/ip#$(command -v ip)#; s#^EnvironmentFile=/#EnvironmentFile=$folder/#" "$unit" >"$units/${unit#"$folder"/etc/systemd/system/}"
  done
  for name in recorder monitor; do cp "$units/roadfix@.service" "$units/roadfix@$name.service"; done
  mkdir "$units/roadfix@recorder.service.d"; cp configs/systemd/realtime.conf "$units/roadfix@recorder.service.d/"
  systemd-analyze verify --man=no "$units/roadfix@recorder.service" "$units/roadfix@monitor.service" "$units/roadfix-multicast.service" "$units/roadfix.target" 2>&1 | grep -F -e roadfix -e "$folder" || true
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

mkdir -p "$folder"/bin "$folder"/vehicle "$folder"/copies
cp configs/demo/calibration.yaml "$folder/vehicle"
echo 'threads: 1' >"$folder/vehicle/vo_tracker.yaml"
echo weights >"$folder/vehicle/superpoint.onnx"
cat >"$folder/vehicle/run.yaml" <<'YAML'
processes:
  - {name: recorder, realtime_priority: 40, arguments: [--folder, "a b%"]}
  - {name: watch, program: monitor}
  - {name: lcm-logger, plain: true}
YAML
ln -s "$bin/roadfix" "$folder/bin/roadfix"
for program in recorder monitor sysctl; do printf '#!/bin/sh\nexit 1\n' >"$folder/bin/$program"; done  # sysctl: a test writes no kernel settings
chmod +x "$folder"/bin/{recorder,monitor,sysctl}
unshare -m true 2>/dev/null || { echo "not tried as root: no right to make a mount namespace"; exit 0; }
status=0
unshare -m bash -s "$folder" <<'ROOT' || status=$?
set -euo pipefail
folder=$1
mount -t tmpfs tmpfs "$folder/copies" || exit 77
for part in etc opt; do
  mkdir "$folder/copies/$part" "$folder/copies/$part.work"
  mount -t overlay overlay -o "lowerdir=/$part,upperdir=$folder/copies/$part,workdir=$folder/copies/$part.work" "/$part" || exit 77
done
[[ ! -d /run/systemd ]] || mount -t tmpfs tmpfs /run/systemd
export PATH=$folder/bin:$PATH ROADFIX_BIN=$folder/bin
fail() { echo "installed as root: $*"; exit 1; }
scripts/install-services "$folder/vehicle" || fail "status $?"
units=/etc/systemd/system
[[ -L $units/multi-user.target.wants/roadfix.target ]] || fail "roadfix.target is not enabled"
for name in recorder watch; do
  [[ -L $units/roadfix.target.wants/roadfix@$name.service && -x /opt/roadfix/bin/$name ]] || fail "$name is not enabled"
done
[[ ! -e /opt/roadfix/bin/lcm-logger ]] || fail "a program that is not ours became a unit"
id roadfix >/dev/null || fail "there is no user"
grep -qF -- '--realtime 40 "--folder" "a b%%"' "$units/roadfix@recorder.service.d/run.conf" || fail "priority and arguments are lost"
grep -q '^LimitRTPRIO=40$' "$units/roadfix@recorder.service.d/run.conf" || fail "the priority is not allowed"
vehicle=/etc/roadfix/vehicle
cmp "$folder/vehicle/superpoint.onnx" $vehicle/superpoint.onnx || fail "the vehicle's folder is not whole"
echo 'threads: 2' >$vehicle/vo_tracker.yaml
rm "$folder/vehicle/vo_tracker.yaml"
scripts/install-services "$folder/vehicle" watch || fail "status $? the second time"
[[ ! -e $vehicle/vo_tracker.yaml ]] || fail "the other vehicle's configuration is still there"
grep -q 2 $vehicle.before/vo_tracker.yaml || fail "what was edited there is lost"
scripts/install-services $vehicle watch || fail "status $? from the installed folder"
[[ -f $vehicle/superpoint.onnx && -f $vehicle.before/vo_tracker.yaml ]] || fail "the installed folder was taken away from itself"
[[ -L $units/roadfix.target.wants/roadfix@watch.service && ! -e $units/roadfix.target.wants/roadfix@recorder.service ]] ||
  fail "the other vehicle's recorder is still enabled"
ROOT
case $status in
  0) echo "installed as root" ;;
  77) echo "not tried as root: this kernel gives no overlay" ;;
  *) exit 1 ;;
esac
