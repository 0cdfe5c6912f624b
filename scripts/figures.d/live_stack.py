"""The whole stack of configs/demo live on UDP in a network namespace, a client at its dashboard, while the demo drive is played again and again:
  unshare -n python3 live_stack.py ROOT FOLDER SPEED SECONDS_OF_DATA
Prints JSON: resident memory of each process over the data played, and the latencies of its recording (tools/experiments/live_latency.cpp)."""
import glob
import json
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

BUS = "udpm://239.255.76.67:7667?ttl=0"
PORT = 8431


def resident_kib(pid):
    with open(f"/proc/{pid}/status") as status:
        return next((int(line.split()[1]) for line in status if line.startswith("VmRSS")), 0)


def write_vehicle(root, folder):
    vehicle = folder / "vehicle"
    shutil.copytree(root / "configs/demo", vehicle)
    (vehicle / "recorder.yaml").write_text(
        f"folder: {folder / 'recordings'}\nmin_free_gib: 0\nsplit_size_mib: 64\nquota_gib: 0.5\nwhen_full: delete_oldest\n")
    (vehicle / "monitor.yaml").write_text(f'recordings: {folder}\ndashboard: {{listen: "127.0.0.1:{PORT}"}}\n')
    return vehicle


def watch_dashboard():
    """Takes the live stream, as a browser does."""
    for _ in range(100):
        try:
            client = socket.create_connection(("127.0.0.1", PORT))
            break
        except OSError:
            time.sleep(0.1)
    client.sendall(b"GET /live HTTP/1.1\r\nHost: localhost\r\n\r\n")

    def read():
        try:
            while client.recv(1 << 16):
                pass
        except OSError:
            pass

    threading.Thread(target=read, daemon=True).start()


def main(root, folder, speed, seconds):
    subprocess.run("ip link set lo up && ip route add 224.0.0.0/4 dev lo", shell=True, check=True)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    programs = root / "build/release/bin"
    stack = subprocess.Popen([programs / "roadfix", "run", write_vehicle(root, folder)], stdout=subprocess.PIPE, text=True,
                             stderr=open(folder / "errors", "w"))
    processes, deaths = {}, []

    def follow():
        for line in stack.stdout:
            if found := re.match(r"(\w+) started, process (\d+)", line):
                processes[found[1]] = int(found[2])
            if "starts again in" in line:
                deaths.append(line.strip())

    threading.Thread(target=follow, daemon=True).start()
    watch_dashboard()
    time.sleep(1)
    player = subprocess.Popen([programs / "loop_player", BUS, root / "logs/demo.lcm", speed, seconds], stdout=subprocess.PIPE, text=True)
    memory, behind_s = [], 0.0
    for line in player.stdout:
        word, value = line.split()
        if word == "played":
            memory.append([int(value), {name: resident_kib(pid) for name, pid in processes.items()}])
        else:
            behind_s = float(value)
    stack.send_signal(signal.SIGINT)
    stack.wait()
    logs = sorted(glob.glob(str(folder / "recordings/*.lcm")))
    latencies = json.loads(subprocess.run([programs / "live_latency", *logs], capture_output=True, text=True, check=True).stdout)
    shutil.rmtree(folder)
    print(json.dumps({"memory": memory, "behind_s": behind_s, "deaths": deaths, **latencies}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], sys.argv[4])
