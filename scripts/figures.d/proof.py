"""proof: what the bus and the order of inputs cost."""
import json

from support import Skipped


def replay_dispatch_us(runs):
    """CPU per small message of a replay through a stage that does nothing; median of five repetitions."""
    text = runs.call(runs.program("bus_bench"), "--benchmark_filter=BM_ReplayDispatch", "--benchmark_format=json",
                     "--benchmark_repetitions=5", "--benchmark_report_aggregates_only=true")
    for row in json.loads(text)["benchmarks"]:
        if row.get("aggregate_name") == "median":
            return row["cpu_per_message_s"] * 1e6
    raise Skipped("bus_bench printed no median")


MEASUREMENTS = {"replay_dispatch_us": replay_dispatch_us}
