"""proof: what the bus and the order of inputs cost."""


def replay_dispatch_us(runs):
    """CPU per small message of a replay through a stage that does nothing."""
    return runs.benchmark("bus_bench", "cpu_per_message_s") * 1e6


def value(text, name):
    """The number behind NAME in lines of "NAME VALUE"."""
    return float(dict(line.split() for line in text.splitlines())[name])


def live_p50_ratio(runs):
    """Median publish-to-handler time of our bus over that of bare LCM, side by side in a network namespace of their own."""
    route = "ip link set lo up && ip route add 224.0.0.0/4 dev lo"
    program = runs.program("bus_figures")
    return value(runs.call("unshare", "-n", "bash", "-c", f"{route} && {program} latency"), "live_p50_ratio")


def index_ratio(runs):
    """Time to index a log of 1 GB over the time to read it, both warm."""
    return value(runs.call(runs.program("bus_figures"), "index", "1000"), "index_ratio")


MEASUREMENTS = {"replay_dispatch_us": replay_dispatch_us, "live_p50_ratio": live_p50_ratio, "index_ratio": index_ratio}
