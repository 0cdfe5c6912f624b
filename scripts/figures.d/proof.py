"""proof: what the bus and the order of inputs cost."""


def replay_dispatch_us(runs):
    """CPU per small message of a replay through a stage that does nothing."""
    return runs.benchmark("bus_bench", "cpu_per_message_s") * 1e6


MEASUREMENTS = {"replay_dispatch_us": replay_dispatch_us}
