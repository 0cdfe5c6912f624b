"""integrity: errors against the protection levels of PROTECTION_INS and PROTECTION_FUSED, the worse of both. The campaign is that of scripts/integrity."""
import importlib.machinery
import importlib.util
import statistics

from support import Skipped

STAGES = "wheel_odometry,gnss_ins_ekf,imm_fusion,integrity"
CHANNELS = ("POSE_INS", "POSE_FUSED")
ACROSS = 1
MOST = 1_000_000
HORIZONTAL = "integrity:\n  alert_limit_m: [1.40, 0.57, 10000.0]\n"
DRAG_SEEDS = 5
DRAGS_MPS = (0.2, 0.4, 0.7, 1.0)
FAULT_FREE = ("city_loop", "highway", "car_park")
# Recordings of ../shared/data with positions, an imu and a reference, as they are and with their fixes cut, thinned out or moved.
REAL = (
    ("adis_semisim",),
    ("adis_semisim", "without=wheels"),
    ("adis_semisim", "cut_gnss_s=60", "every_s=180", "after_s=300", "phase_s=0,90"),
    ("adis_semisim", "without=wheels", "cut_gnss_s=30", "every_s=180", "after_s=300", "phase_s=0"),
    ("adis_semisim", "spike_m=20", "every_fix=90", "azimuth_seed=1"),
    ("adis_semisim", "cut_gnss_s=30", "every_s=180", "after_s=300", "phase_s=0", "bias_m=15", "fixes=5", "azimuth_seed=1"),
    ("car_0708",),
    ("car_0708", "gnss_every=4"),
    ("car_0708", "cut_gnss_s=30", "every_s=90", "after_s=60", "phase_s=0,45"),
    ("malaga07_part1",),
)


def script(runs):
    """scripts/integrity as a module."""
    def load():
        loader = importlib.machinery.SourceFileLoader("integrity_campaign", str(runs.root / "scripts" / "integrity"))
        module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
        loader.exec_module(module)
        return module

    return runs.once("integrity script", load)


def campaign(runs):
    def run():
        module = script(runs)
        _, whole, failed = module.totals(module.campaign(runs.work / "integrity"))
        if failed:
            raise Skipped(f"{failed} drives of the campaign have no result")
        fewest = min(count.samples for count in whole.values())
        if fewest < MOST:
            raise Skipped(f"the campaign has {fewest} samples")
        return whole

    return runs.once("integrity campaign", run)


def misleading(risk):
    return lambda runs: max(count.share(risk) for count in campaign(runs).values())


def protections(drives):
    return [channels[channel]["protection"] for channels, _ in drives for channel in CHANNELS if channels.get(channel, {}).get("protection")]


def real_misleading(runs):
    """Samples above either level, over all recordings."""
    found = []
    for drive, *words in REAL:
        found += protections(runs.recorded(STAGES, drive, *words))
    if len(found) < 2 * len(REAL):
        raise Skipped("a recording has no levels")
    return sum(max(risk["misleading"] for risk in p["risks"]) for p in found)


def width(runs):
    """Median of all drives' ratios: the lateral level at 1e-3 over the 95 % error."""
    ratios = []
    for scenario in FAULT_FREE:
        for p in protections(runs.fleet(STAGES, scenario, 10, "camera=none")):
            ratios.append(p["risks"][0]["median_m"][ACROSS] / p["error_p95_m"][ACROSS])
    return statistics.median(ratios)


def available_freeway(runs):
    """Share of the samples of highways whose lateral and longitudinal levels at 1e-5 are within the limits."""
    tuning = runs.folder("integrity_tuning")
    (tuning / "integrity.yaml").write_text(HORIZONTAL)
    found = protections(runs.fleet(STAGES, "highway", 10, "camera=none", config=tuning))
    return sum(p["risks"][1]["available"] for p in found) / sum(p["samples"] + p["unbounded"] for p in found)


def drag_alert_s(runs):
    """The longest stretch, usable by its flag, with an error above its level at 1e-3; worst of 20 drags on city streets."""
    faults = [f"fault=gnss.ramp@60+40:east_mps={0.8 * v:.2f},north_mps={0.6 * v:.2f}" for v in DRAGS_MPS]
    found = []
    for fault in faults:
        found += protections(runs.fleet(STAGES, "city_loop", DRAG_SEEDS, "camera=none", "duration_s=120", fault))
    return max(p["longest_misled_s"] for p in found)


MEASUREMENTS = {
    "misleading_1e3": misleading(0),
    "misleading_1e5": misleading(1),
    "real_misleading": real_misleading,
    "width": width,
    "available_freeway": available_freeway,
    "drag_alert_s": drag_alert_s,
}
