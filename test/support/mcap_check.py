"""A log, its MCAP export and what the official reader (@mcap/core, from npm) gives back: message by message, value by value."""
import hashlib
import json
import math
import shutil
import subprocess
from pathlib import Path

from lcm_log import Types, events, type_of_channel

SUPPORT = Path(__file__).resolve().parent
PACKAGES = ("@mcap/core@2", "protobufjs@7", "fzstd@0")


class Missing(Exception):
    """What the check needs and is not here."""


def node_modules(folder):
    """The folder that has the official reader; from npm's registry where it is not there yet."""
    if not shutil.which("node") or not shutil.which("npm"):
        raise Missing("node and npm are not installed")
    if not (folder / "node_modules" / "fzstd").is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        command = ["npm", "install", "--no-audit", "--no-fund", "--prefix", str(folder), *PACKAGES]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
        except subprocess.TimeoutExpired:
            raise Missing("npm's registry does not answer") from None
        if done.returncode != 0:
            raise Missing(f"npm cannot install {PACKAGES[0]}: {(done.stderr.strip().splitlines() or ['no output'])[-1]}")
    return folder


def official(folder, path, how):
    """(messages by topic in the file's order, facts of the file) as the official reader sees them."""
    command = ["node", str(SUPPORT / "mcap_read.mjs"), str(node_modules(folder)), str(path), how]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"@mcap/core does not read {path}: {done.stderr.strip()[-500:]}")
    topics, facts = {}, None
    for line in done.stdout.splitlines():
        message = json.loads(line)
        if "file" in message:
            facts = message["file"]
        else:
            topics.setdefault(message["topic"], []).append(message)
    return topics, facts


def as_json(value, name=""):
    """A decoded message as export's JSON has it."""
    if isinstance(value, dict):
        return {key: as_json(one, key) for key, one in value.items()}
    if isinstance(value, list):
        return [as_json(one, name) for one in value]
    if isinstance(value, bytes):
        return value
    if name in ("digest", "config_hash"):
        return str(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def equal(kind, wanted, found):
    """Whether every field of a message came back; floats of 32 bits are compared as such."""
    import base64
    import struct
    if isinstance(wanted, dict):
        left_out = {"data"} if kind == "image_t" else set()
        if not isinstance(found, dict) or set(wanted) - left_out != set(found):
            return False
        return all(equal(kind, wanted[key], found[key]) for key in found)
    if isinstance(wanted, list):
        return isinstance(found, list) and len(wanted) == len(found) and all(map(lambda a, b: equal(kind, a, b), wanted, found))
    if isinstance(wanted, bytes):
        return base64.b64decode(found) == wanted
    if isinstance(wanted, float) and isinstance(found, (int, float)) and wanted != found:
        return kind == "vo_features_t" and struct.pack("f", found) == struct.pack("f", wanted)
    return wanted == found and isinstance(found, bool) == isinstance(wanted, bool)


def compare(root, log, topics):
    """(messages that came back with equal values, messages of the log)."""
    types = Types(root / "lcmtypes")
    counts, same, total = {}, 0, 0
    for channel, timestamp, data in events(log):
        total += 1
        kind = type_of_channel(channel)
        place = counts[channel] = counts.get(channel, -1) + 1
        messages = topics.get("/" + channel, [])
        if kind is None or place >= len(messages):
            continue
        message = messages[place]
        wanted = types.decode(kind, data)
        good = equal(kind, as_json(wanted), json.loads(message["text"]))
        good = good and int(message["log"]) == timestamp * 1000 and int(message["publish"]) == wanted["utime"] * 1000
        if kind == "image_t":
            picture = topics[f"/{channel}/image"][place]["value"]
            good = good and picture["data"] == hashlib.sha256(wanted["data"]).hexdigest()
        same += good
    return same, total
