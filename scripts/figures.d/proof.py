"""proof: what the bus and the order of inputs cost, and whether live equals replay."""
import statistics

from support import Skipped


def replay_dispatch_us(runs):
    """CPU per small message of a replay through a stage that does nothing."""
    return runs.benchmark("bus_bench", "cpu_per_message_s") * 1e6


def value(text, name):
    """The number behind NAME in lines of "NAME VALUE"."""
    return float(dict(line.split() for line in text.splitlines())[name])


def live_p50_ratio(runs):
    """Median publish-to-handler time of our bus over that of bare LCM, side by side in a network namespace of their own;
    median of five runs, with real-time priority so that other load does not decide."""
    route = "ip link set lo up && ip route add 224.0.0.0/4 dev lo"
    measure = f"{route} && chrt -f 20 {runs.program('bus_figures')} latency"
    return statistics.median(value(runs.call("unshare", "-n", "bash", "-c", measure), "live_p50_ratio") for _ in range(5))


def index_ratio(runs):
    """Time to index a log of 1 GB over the time to read it, both warm."""
    return value(runs.call(runs.program("bus_figures"), "index", "1000"), "index_ratio")


def live_verdict(runs, script, *arguments):
    """(identical, differing, unverifiable) of a live run on real UDP; the last line says them in this order."""
    command = [str(runs.root / "test" / "bus" / script), str(runs.bin), *map(str, arguments)]
    text = runs.call("bash", "-c", '"$@" || true', "bash", *command)
    for line in reversed(text.splitlines()):
        if line.startswith(("identical ", "verify: ")):
            return [int(word.strip(",")) for word in line.split() if word.strip(",").isdigit()]
    raise Skipped(text.splitlines()[-1] if text else f"{script} said nothing")


def verify_identical(runs):
    """Share of the shipped stages' outputs that verify finds identical after a clean live run of the demo drive."""
    counts = live_verdict(runs, "stack.sh", runs.root / "configs" / "demo", runs.root / "logs" / "demo.lcm", 60)
    return counts[0] / sum(counts)


def verify_differing(runs):
    """Outputs that differ after live runs with a starved stage, 0.1 % IP loss and a killed stage."""
    return sum(live_verdict(runs, "live.sh", trouble)[1] for trouble in ("starved", "ip_loss", "killed"))


MEASUREMENTS = {"replay_dispatch_us": replay_dispatch_us, "live_p50_ratio": live_p50_ratio, "index_ratio": index_ratio,
                "verify_identical": verify_identical, "verify_differing": verify_differing}
