"""operation: what it costs to look, how soon there is something to see, how fast the live stack is, and whether it grows."""
import json
import os
import re
import socket
import statistics
import subprocess
import sys
import threading
import time

from browser import Browser, chromium
from support import Skipped

SETTLE_S, MEASURE_S = 6, 15
CLIENTS = 10  # one of them takes nothing


class Monitor:
    """A monitor with its dashboard on a port of its own."""

    def __init__(self, runs, *arguments):
        words = [str(runs.program("monitor")), "--config", str(runs.root / "configs/demo"), *map(str, arguments)]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.url = None
        if "--no-dashboard" not in words:
            found = re.search(r"http://\S+", self.process.stdout.readline())
            if not found:
                raise Skipped("the monitor names no address of its dashboard")
            self.url = found[0]
        threading.Thread(target=self.process.stdout.read, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()

    def cpu_s(self):
        with open(f"/proc/{self.process.pid}/stat") as stat:
            fields = stat.read().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Client:
    """A client of the live stream; one that does not read fills its buffers and stands."""

    def __init__(self, url, reads):
        address = re.match(r"http://([^:/]+):(\d+)", url)
        self.frames = 0
        self.socket = socket.socket()
        if not reads:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self.socket.connect((address[1], int(address[2])))
        self.socket.sendall(b"GET /live HTTP/1.1\r\nHost: localhost\r\n\r\n")
        if reads:
            threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        try:
            while text := self.socket.recv(1 << 16):
                self.frames += text.count(b"data: ")
        except OSError:
            pass


def measured_in_namespace(runs):
    """Shares of one core, per cent: a monitor without a dashboard, and one with ten clients, beside each other on the
    demo drive and its estimates, played by lcm-logplayer."""
    log = runs.root / "logs/demo.lcm"
    estimates = runs.folder("dashboard") / "out.lcm"
    runs.roadfix("replay", log, "--stages", "wheel_odometry,gnss_ins_ekf,imm_fusion", "--config", runs.root / "configs/demo", "--out", estimates)
    players = [subprocess.Popen(["lcm-logplayer", str(path)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for path in (log, estimates)]
    try:
        with Monitor(runs, "--plain", "--no-dashboard") as bare, Monitor(runs, "--plain", "--listen", "127.0.0.1:0") as watched:
            clients = [Client(watched.url, reads=i > 0) for i in range(CLIENTS)]
            time.sleep(SETTLE_S)
            before = bare.cpu_s(), watched.cpu_s(), time.monotonic()
            time.sleep(MEASURE_S)
            span = time.monotonic() - before[2]
            shares = [100 * (m.cpu_s() - b) / span for m, b in zip((bare, watched), before)]
            fewest = min(client.frames for client in clients[1:])
            if fewest < 4 * MEASURE_S:
                raise Skipped(f"a client got only {fewest} frames: there was nothing to measure")
            for client in clients:
                client.socket.close()
            return shares
    finally:
        for player in players:
            player.kill()
            player.wait()


def dashboard_cpu_pct(runs):
    """What the dashboard adds to the monitor's CPU."""
    script = ("import sys; sys.path[:0] = [sys.argv[1]]; import time; from pathlib import Path; import operation, support; "
              "print(*operation.measured_in_namespace(support.Runs(Path(sys.argv[2]), time.monotonic() + 300)))")
    route = "ip link set lo up && ip route add 224.0.0.0/4 dev lo"
    here = runs.root / "scripts/figures.d"
    text = runs.call("unshare", "-n", "bash", "-c", f'{route} && python3 -B -c "$0" "$@"', script, here, runs.root)
    bare, watched = map(float, text.split())
    print(f"figures: monitor alone {bare:.2f} %, with {CLIENTS} clients {watched:.2f} %", file=sys.stderr)
    return watched - bare


def first_paint_ms(runs):
    """First contentful paint of the page over loopback, from the start of navigation; median of five."""
    if not chromium():
        raise Skipped("no chromium here")
    with Monitor(runs, "--log-in", runs.root / "logs/demo.lcm", "--listen", "127.0.0.1:0") as monitor, Browser() as browser:
        browser.size(1280, 900)
        paints = []
        for _ in range(5):
            browser.go(monitor.url)
            time.sleep(1)
            paint = browser.wait("document.documentElement.dataset.firstPaintMs")
            if paint:
                paints.append(float(paint))
            browser.go("about:blank")
        if not paints:
            raise Skipped("the browser tells of no paint")
        return statistics.median(paints)


LIVE_S = 80
SOAK_S, SOAK_SPEED = 3600, 4  # an hour of data, as fast as a tracker beside everything else keeps up with on one core


def live_stack(runs, name, speed, seconds):
    """What live_stack.py measures."""
    def run():
        script = runs.root / "scripts/figures.d/live_stack.py"
        result = json.loads(runs.call("unshare", "-n", sys.executable, "-B", script, runs.root, runs.work / name, speed, seconds))
        if result["deaths"]:
            raise Skipped("died: " + "; ".join(result["deaths"]))
        return result

    return runs.once(("live", name), run)


def imu_to_ins_p50_us(runs):
    return live_stack(runs, "live", 1, LIVE_S)["imu_to_ins_p50_us"]


def camera_to_fused_p99_ms(runs):
    result = live_stack(runs, "live", 1, LIVE_S)
    print(f"figures: {result['pictures']} pictures, median {result['camera_to_fused_p50_ms']:.0f} ms", file=sys.stderr)
    return result["camera_to_fused_p99_ms"]


def soak_rss_growth_pct(runs):
    """Of the process that grows most: median of the last ten minutes of data against the ten minutes after the first half hour."""
    result = live_stack(runs, "soak", SOAK_SPEED, SOAK_S)
    growth = {}
    for name in result["memory"][-1][1]:
        early = [memory[name] for at, memory in result["memory"] if SOAK_S / 2 <= at < SOAK_S / 2 + 600 and name in memory]
        late = [memory[name] for at, memory in result["memory"] if at >= SOAK_S - 600 and name in memory]
        if not early or not late:
            raise Skipped(f"{name} was not there all the time")
        growth[name] = 100 * (statistics.median(late) / statistics.median(early) - 1)
        print(f"figures: {name}: {statistics.median(early) / 1024:.1f} MiB, then {growth[name]:+.2f} %", file=sys.stderr)
    print(f"figures: IMU to INS, median of the first quarter {result['imu_to_ins_first_us']:.0f} us, of the last {result['imu_to_ins_last_us']:.0f} us; "
          f"the player was {result['behind_s']:.2f} s behind at most", file=sys.stderr)
    return max(growth.values())


MEASUREMENTS = {"dashboard_cpu_pct": dashboard_cpu_pct, "first_paint_ms": first_paint_ms,
                "imu_to_ins_p50_us": imu_to_ins_p50_us, "camera_to_fused_p99_ms": camera_to_fused_p99_ms,
                "soak_rss_growth_pct": soak_rss_growth_pct}
