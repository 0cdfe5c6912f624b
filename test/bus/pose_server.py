"""pose_server on a real bus and real sockets, in a network namespace of its own: pose_server.py BIN LOG.

A TCP client that never reads, one that reads, a UDP receiver, a pseudo-terminal, and the GNSS driver as a client. None disturbs another,
all get the same sentences, and what the driver makes of them is the position that was sent. Then the poses stop: so do the positions.
"""
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from functools import reduce
from pathlib import Path

BIN, LOG = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
GNSS_BUS = "udpm://239.255.76.67:7700?ttl=0"  # the driver's messages must not meet those of the drive


def enter_namespace():
    if os.environ.get("ROADFIX_IN_NAMESPACE"):
        subprocess.run("ip link set lo up && ip route add 224.0.0.0/4 dev lo", shell=True, check=True)
        return
    if shutil.which("lcm-logplayer") is None:
        print("skipped: no lcm-logplayer")
        sys.exit(0)
    if subprocess.run(["unshare", "-n", "true"], capture_output=True, check=False).returncode != 0:
        print("skipped: no right to make a network namespace")
        sys.exit(0)
    os.environ["ROADFIX_IN_NAMESPACE"] = "1"
    os.execvp("unshare", ["unshare", "-n", sys.executable, *sys.argv])


def fail(text):
    print(text)
    sys.exit(1)


def check(good, text):
    if not good:
        fail(text)


class Reader:
    """Whole sentences from a non-blocking descriptor, with the time of arrival."""

    def __init__(self, descriptor):
        self.descriptor, self.rest, self.lines, self.ended = descriptor, b"", [], False
        os.set_blocking(descriptor, False)

    def poll(self):
        try:
            while data := os.read(self.descriptor, 65536):
                *lines, self.rest = (self.rest + data).split(b"\r\n")
                self.lines += [(time.monotonic(), line.decode("ascii")) for line in lines]
            self.ended = True
        except BlockingIOError:
            pass
        except ConnectionError:
            self.ended = True

    def of(self, kind):
        return [line.split("*")[0].split(",") for _, line in self.lines if line[3:6] == kind]


def checksum_holds(line):
    body, _, told = line[1:].partition("*")
    return line[0] == "$" and told == f"{reduce(lambda a, b: a ^ b, body.encode()):02X}"


def watch(readers, seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for reader in readers:
            reader.poll()
        time.sleep(0.01)


def watch_until(readers, done):
    """For a minute at most, however slowly everything runs."""
    end = time.monotonic() + 60.0
    while time.monotonic() < end and not done():
        watch(readers, 0.2)


def start(processes, *command, **options):
    process = subprocess.Popen([str(word) for word in command], **options)
    processes.append(process)
    return process


def tcp_client(receive_buffer=None):
    client = socket.socket()
    if receive_buffer:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
    client.connect(("127.0.0.1", 10110))
    return client


def begin(processes, folder):
    (folder / "pose_server.yaml").write_text("patience_s: 2\nrates: {gga_hz: 10, rmc_hz: 10, vtg_hz: 10, hdt_hz: 10, gst_hz: 10, zda_hz: 10}\n")
    server = start(processes, BIN / "pose_server", "--config", folder, "--pose", "REFERENCE", "--udp", "127.0.0.1:10111", "--serial", "pty:",
                   stdout=subprocess.PIPE, text=True)
    told = server.stdout.readline()
    found = re.fullmatch(r"REFERENCE as NMEA to tcp 127.0.0.1:10110, udp 127.0.0.1:10111, serial (/dev/pts/\d+)\n", told)
    check(found, f"pose_server said: {told}")
    return server, found.group(1)


def positions(reader):
    return [fields for fields in reader.of("GGA") if fields[6] != "0"]


def check_sentences(reader, name, count):
    check(all(checksum_holds(line) for _, line in reader.lines), f"{name}: a sentence's checksum is wrong")
    with_position = positions(reader)
    check(len(with_position) >= count, f"{name}: {len(with_position)} positions, not {count}")
    times = [fields[1] for fields in with_position]
    check(times == sorted(set(times)), f"{name}: times do not go forward")


def check_driver(folder, recorder, reader):
    """What the GNSS driver published is what was sent."""
    recorder.send_signal(signal.SIGINT)
    recorder.wait(10)
    watch([reader], 0.5)  # the driver may have been told more since
    sent = [fields for fields in reader.of("GGA") if fields[6] != "0"]
    log = next((folder / "recordings").glob("*.lcm"))
    info = subprocess.run([BIN / "roadfix", "log", "info", log], capture_output=True, text=True, check=True).stdout
    rows = [line.split() for line in info.splitlines() if line.startswith("GNSS ")]
    check(rows and int(rows[0][2]) > 20, f"the GNSS driver published too little:\n{info}")
    try:
        sys.path.insert(0, str(LOG.parent.parent / "python"))
        sys.dont_write_bytecode = True
        import numpy as np
        import roadfix_log
    except ImportError:
        return
    gnss = roadfix_log.read(log)["GNSS"]
    told = np.array([(degrees(fields[2], fields[3]), degrees(fields[4], fields[5])) for fields in sent])
    fixes = np.column_stack([gnss.lat_deg, gnss.lon_deg])[gnss.fix_type != gnss.constants["FIX_NONE"]]
    off_deg = [np.abs(told - fix).max(axis=1).min() for fix in fixes]
    check(len(np.unique(fixes, axis=0)) > 20, f"only {len(fixes)} fixes of the GNSS driver could be compared")
    check(max(off_deg) < 1e-9, f"the GNSS driver read a position that was not sent, {max(off_deg)} deg off")


def degrees(text, hemisphere):
    value = int(text[:-9]) + float(text[-9:]) / 60
    return -value if hemisphere in "SW" else value


def run(processes, folder):
    server, terminal = begin(processes, folder)
    stuck = tcp_client(receive_buffer=2048)
    client = tcp_client()
    datagrams = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    datagrams.bind(("127.0.0.1", 10111))
    readers = {"tcp": Reader(client.fileno()), "udp": Reader(datagrams.fileno()), "pty": Reader(os.open(terminal, os.O_RDONLY | os.O_NOCTTY))}
    (folder / "gnss_driver.yaml").write_text("device: tcp:127.0.0.1:10110\n")
    start(processes, BIN / "gnss_driver", "--config", folder, "--bus", GNSS_BUS)
    recorder = start(processes, BIN / "recorder", "--bus", GNSS_BUS, "--folder", folder / "recordings", stdout=subprocess.DEVNULL)
    player = start(processes, "lcm-logplayer", LOG, stdout=subprocess.DEVNULL)
    count = 100  # of 10 Hz, and far more than fits into the buffers of the client that takes nothing
    watch_until(readers.values(), lambda: all(len(positions(reader)) >= count for reader in readers.values()))
    for name, reader in readers.items():
        check_sentences(reader, name, count)
    pty_lines, tcp_lines = {line for _, line in readers["pty"].lines}, {line for _, line in readers["tcp"].lines}
    check(len(pty_lines & tcp_lines) > 0.8 * len(tcp_lines), "the pseudo-terminal got other sentences than TCP")
    check_driver(folder, recorder, readers["tcp"])

    player.send_signal(signal.SIGSTOP)
    watch(readers.values(), 2.0)
    stopped = len(readers["tcp"].lines)
    watch(readers.values(), 2.0)
    silent = [line for _, line in readers["tcp"].lines[stopped:] if line[3:6] in ("GGA", "RMC")]
    check(len(silent) > 10 and all(",0,,,,M" in line or ",V,," in line for line in silent), f"positions without poses: {silent[:4]}")

    reader = Reader(stuck.fileno())
    watch([reader, *readers.values()], 1.0)
    check(reader.ended, "the client that took nothing for longer than patience_s is still there")
    check(not readers["tcp"].ended, "the client that reads was let go")
    server.send_signal(signal.SIGTERM)
    check(server.wait(10) == 0, f"pose_server ended with {server.returncode}")


def main():
    enter_namespace()
    processes = []
    with tempfile.TemporaryDirectory() as name:
        try:
            run(processes, Path(name))
        finally:
            for process in processes:
                if process.poll() is None:
                    process.kill()
                    process.wait()
    print("pose_server: all clients served")


main()
