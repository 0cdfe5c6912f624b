"""navigation: the one filter. Its camera on simulated drives (tracks without pixels, build/release/bin/navigation_tracks)."""
import json
import statistics

from support import root_mean_square

SEEDS = 20
SCENARIO = "tunnel_lit"


def drives(runs, *flags):
    """The lines of navigation_tracks, one a seed."""

    def run():
        text = runs.call(runs.program("navigation_tracks"), SCENARIO, 1, SEEDS, *flags)
        return [json.loads(line) for line in text.splitlines()]

    return runs.once(("navigation_tracks", flags), run)


def tracks_lit(runs):
    """Horizontal error 50 to 60 s after the loss, pooled, with two eyes over without a camera."""
    pooled = [root_mean_square(d["h_last_m"] for d in drives(runs, "--eyes", eyes)) for eyes in (2, 0)]
    return pooled[0] / pooled[1]


def no_wheels(runs):
    return statistics.median(100 * d["h_end_m"] / d["way_m"] for d in drives(runs, "--eyes", 1, "--no-wheels"))


MEASUREMENTS = {
    "tracks_lit_vs_ins": tracks_lit,
    "no_wheels_end_pct": no_wheels,
}
