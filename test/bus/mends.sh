#!/usr/bin/env bash
# Every mend that `roadfix doctor` names: each thing is broken first, in namespaces of our own with copies of /etc and a made /dev, the mend is taken
# from what doctor prints and run as it stands, and doctor must find the thing well afterwards. What cannot be broken here says "not tried" and why.
# Those that fetch packages are tried by `mends.sh BIN packages`, where ROADFIX_TEST_NETWORK is set: the packages are taken away and brought back.
#   mends.sh BIN [packages]
set -uo pipefail
bin=$(realpath "$1"); part=${2:-machine}
cd "$(dirname "$0")/../.."
if [[ -z ${ROADFIX_IN_NAMESPACE:-} ]]; then
  [[ $(id -u) == 0 ]] && unshare -n -m true 2>/dev/null || { echo "skipped: no right to make namespaces"; exit 0; }
  [[ $part == machine || -n ${ROADFIX_TEST_NETWORK:-} ]] || { echo "skipped: fetches packages; set ROADFIX_TEST_NETWORK=1"; exit 0; }
  spaces=(-m); [[ $part == machine ]] && spaces=(-m -n)
  exec env ROADFIX_IN_NAMESPACE=1 unshare "${spaces[@]}" "$0" "$bin" "$part"
fi
mount --make-rprivate /
folder=$(mktemp -d); trap 'umount -l /etc /dev 2>/dev/null; rm -rf --one-file-system "$folder"' EXIT
chmod 755 "$folder"
cp "$bin/roadfix" "$folder/roadfix"  # where everybody may read it
bad=0 tried=0
fail() { echo "mends: $*"; bad=1; }
not_tried() { echo "not tried: $1: $2"; }
# finding CHECK: its line in what is on standard input, and what stands under it.
finding() { awk -v check="$1" '/^(ok|warning|ERROR) / { of = index($0, check) == 10 } of'; }
# mended CHECK [WRAPPER...] with DOCTOR'S ARGUMENTS: it is broken now; its mend is run; it is well. WRAPPER runs doctor as somebody else.
mended() {
  local check=$1 wrapper=() before mend after; shift
  while [[ $1 != with ]]; do wrapper+=("$1"); shift; done; shift
  before=$("${wrapper[@]}" timeout 60 "$folder/roadfix" doctor "$@" 2>&1 | finding "$check")
  grep -q '^warning\|^ERROR' <<<"$before" || { fail "$check is not broken: $before"; return; }
  mend=$(sed -n 's/^ *mend: //p' <<<"$before")
  [[ -n $mend ]] || { fail "$check: no mend in: $before"; return; }
  tried=$((tried + 1))
  eval "$mend" >"$folder/mend" 2>&1 || { fail "$check: '$mend' ends with $?: $(cat "$folder/mend")"; return; }
  after=$("${wrapper[@]}" timeout 60 "$folder/roadfix" doctor "$@" 2>&1 | finding "$check")
  grep -q '^warning\|^ERROR' <<<"$after" && { fail "$check after '$mend': $after"; return; }
  grep -q '^ok' <<<"$after" || grep -q 'ipfrag_time' <<<"$check" || { fail "$check after '$mend' is gone: $after"; return; }
  echo "mended: $check: $mend"
}
local_url='udpm://239.255.76.67:7667?ttl=0' far_url='udpm://239.255.76.67:7667?ttl=1'

if [[ $part == packages ]]; then
  for part in usr etc var build; do  # what changes lies in this folder and goes with it
    of=/$part; [[ $part == build ]] && of=$PWD/build/release
    mkdir -p "$folder/$part/upper" "$folder/$part/work"
    mount -t overlay overlay -o "lowerdir=$of,upperdir=$folder/$part/upper,workdir=$folder/$part/work" "$of" || fail "no overlay of $of"
  done
  export DEBIAN_FRONTEND=noninteractive
  { apt-get purge -y 'openjdk-17-*' && rm -rf /usr/lib/jvm /usr/bin/java /etc/alternatives/java; } >"$folder/said" 2>&1 || fail "$(tail -n 3 "$folder/said")"
  mended 'java' with --no-loopback
  apt-get purge -y liblcm-java libjchart2d-java >"$folder/said" 2>&1 || fail "$(tail -n 3 "$folder/said")"
  mended 'lcm-spy' with --no-loopback
  [[ $bad -eq 0 ]] && echo "$tried mends"
  exit $bad
fi

# The bus. A new network namespace has no route, and its loop-back is down.
mended 'multicast route' with --no-loopback --bus "$local_url"
ip link add eth0 type veth peer name eth1 && ip link set eth1 up && ip addr add 10.9.8.7/24 dev eth0 && ip link set eth0 up
ip route del 224.0.0.0/4 dev lo; ip route add default dev eth0
mended 'multicast route' with --no-loopback --bus "$local_url"
ip route replace unreachable 224.0.0.0/4
mended 'loop-back' with --bus "$local_url"
export LCM_DEFAULT_URL=$far_url
mended 'ttl' with --no-loopback
unset LCM_DEFAULT_URL
mended 'net.ipv4.ipfrag_high_thresh' with --no-loopback --bus "$far_url"
sysctl -qw net.ipv4.ipfrag_time=30
mended 'net.ipv4.ipfrag_time' with --no-loopback --bus "$far_url"
# The socket buffers are the whole machine's: these files take the kernel's place.
mkdir "$folder/core"; for key in rmem_max rmem_default; do echo 212992 >"$folder/core/$key"; done
if mount --bind "$folder/core" /proc/sys/net/core 2>"$folder/said"; then
  mended 'net.core.rmem_max' with --no-loopback
  mended 'net.core.rmem_default' with --no-loopback
  umount /proc/sys/net/core
else
  not_tried 'net.core.rmem_max' "$(cat "$folder/said")"
fi
not_tried 'clock' 'no test sets the clock of the machine that it runs on'
mended 'disk' with --no-loopback --logs "$folder/recordings" --space-gib 0

# Settings, services, rights: in copies of /etc and /dev.
cp -a /etc "$folder/etc"; mount --bind "$folder/etc" /etc
rm -f /etc/sysctl.d/60-roadfix.conf /etc/security/limits.d/roadfix.conf; rm -rf /etc/systemd/system/roadfix*
mended 'settings over a restart' with --no-loopback
if command -v systemctl >/dev/null; then
  ROADFIX_BIN=$bin DESTDIR=$folder/root scripts/install-services configs/demo >/dev/null
  mkdir -p /etc/systemd/system; cp -r "$folder"/root/etc/systemd/system/. /etc/systemd/system
  export SYSTEMD_OFFLINE=1  # the links are what enabling is; there is no manager to ask
  mended 'services' with --no-loopback
else
  not_tried 'services' 'no systemctl'
fi
as_nobody=(su -s /bin/bash -c 'cd / && exec "$0" "$@"' -- nobody)
if "${as_nobody[@]}" true 2>"$folder/said" && grep -q '^session.*pam_limits' /etc/pam.d/su; then
  if bash -c 'ulimit -r 60' 2>/dev/null; then
    mended 'real time' "${as_nobody[@]}" with --no-loopback
  else
    not_tried 'real time' 'no right to raise a limit here (CAP_SYS_RESOURCE)'
  fi
  mkdir "$folder/dev"; cp -a /dev/null /dev/zero /dev/full /dev/random /dev/urandom /dev/tty "$folder/dev"
  ln -s /proc/self/fd "$folder/dev/fd"; mknod "$folder/dev/ttyACM0" c 1 3; chgrp dialout "$folder/dev/ttyACM0"; chmod 660 "$folder/dev/ttyACM0"
  mount --bind "$folder/dev" /dev
  USER=nobody mended 'device' "${as_nobody[@]}" with --no-loopback
  umount /dev
else
  not_tried 'real time, device' "no su to another user with its limits: $(cat "$folder/said")"
fi
umount /etc

# lcm-spy. The build folder is covered, so that nothing of it changes.
if [[ $bin != "$PWD/build/release/bin" ]]; then
  not_tried 'types for lcm-spy' "they are made in build/release, this is $bin"
elif [[ ! -f build/release/roadfix_types.jar ]] || ! command -v javac >/dev/null; then
  not_tried 'types for lcm-spy' 'no Java here'
else
  not_tried 'java, lcm-spy' 'packages come over the network: mends.sh BIN packages'
  mkdir "$folder/cover"; mount -t tmpfs none "$folder/cover"; mkdir "$folder/cover/upper" "$folder/cover/work"
  mount -t overlay overlay -o "lowerdir=$PWD/build/release,upperdir=$folder/cover/upper,workdir=$folder/cover/work" build/release
  cp build/release/bin/roadfix build/release/bin/roadfix.copy && mv build/release/bin/roadfix.copy build/release/bin/roadfix
  rm build/release/roadfix_types.jar
  keep=$folder; folder=$PWD/build/release/bin
  mended 'types for lcm-spy' with --no-loopback
  folder=$keep
  umount build/release; umount "$folder/cover"
fi
[[ $bad -eq 0 ]] && echo "$tried mends"
exit $bad
