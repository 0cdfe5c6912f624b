"""A notebook as a script: how good was the pose, and was it honest about it? Run it, or open its cells (# %%) in an editor.

  python3 python/examples/look_at_a_drive.py [LOG] [--pose POSE_INS] [--plot FILE.png]

LOG needs a REFERENCE channel and poses, for example what this makes of the demo drive:
  build/release/bin/roadfix replay logs/demo.lcm --stages gnss_ins_ekf --config configs/demo --out out.lcm
"""
# %% Open the log: nothing is read yet but where its events are.
import argparse

import numpy as np
import roadfix_log

parser = argparse.ArgumentParser(description="Error and claim of a pose against the reference.")
parser.add_argument("log", nargs="?", default="out.lcm")
parser.add_argument("--pose", default="POSE_INS")
parser.add_argument("--plot", help="write a picture (needs python3-matplotlib)")
options = parser.parse_args()
log = roadfix_log.read(options.log)
print(log)

# %% Channels are arrays with the names of the .lcm files: units are in the names.
pose, reference = log[options.pose], log["REFERENCE"]
usable = (pose.validity != pose.constants["VALIDITY_INVALID"]) & (pose.frame == pose.constants["FRAME_ENU"])
print(f"{options.pose}: {pose.messages} poses, {usable.mean():.1%} usable, fields {', '.join(list(pose)[:6])} ...")
if not usable.any():
    raise SystemExit(f"{options.pose} has no usable pose in an ENU frame: compare it with roadfix evaluate, which aligns")

# %% Error against the reference, at the reference's times; each estimator has the ENU frame of the place where it began.
position_m = roadfix_log.change_anchor(pose.position_m[usable], roadfix_log.anchor(pose), roadfix_log.anchor(reference))
t_s = (reference.utime - reference.utime[0]) * 1e-6
at_s = (pose.utime[usable] - reference.utime[0]) * 1e-6
covered = (t_s >= at_s[0]) & (t_s <= at_s[-1])
t_s = t_s[covered]
estimate = np.column_stack([np.interp(t_s, at_s, position_m[:, axis]) for axis in range(2)])
error = estimate - reference.position_m[covered, :2]
error_m = np.hypot(*error.T)
print(f"horizontal error: median {np.median(error_m):.3f} m, RMSE {np.sqrt(np.mean(error_m**2)):.3f} m, 95 % {np.quantile(error_m, 0.95):.3f} m")

# %% And the claim: how many of these errors are inside of three sigma of the covariance that was published?
claimed = pose.cov_pose_m2_rad2[usable][:, :2, :2]
nearest = np.clip(np.searchsorted(at_s, t_s), 0, len(at_s) - 1)
nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(claimed[nearest]), error)
print(f"NEES/2: mean {nees.mean() / 2:.2f}; inside of 3 sigma: {(nees < 9).mean():.1%}")

# %% Draw it, where matplotlib is there.
if options.plot:
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    sigma_m = np.sqrt(np.linalg.eigvalsh(claimed[nearest])[:, 1])
    plt.figure(figsize=(9, 4))
    plt.fill_between(t_s, 3 * sigma_m, alpha=0.2, label="3 sigma claimed")
    plt.plot(t_s, error_m, label="horizontal error")
    plt.xlabel("s")
    plt.ylabel("m")
    plt.legend()
    plt.savefig(options.plot, dpi=120)
