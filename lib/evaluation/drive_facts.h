/// What the evaluation must know about a drive: the content of CONFIG_DRIVE's config_yaml. `roadfix import` writes it,
/// `roadfix evaluate` reads it. No YAML here: lib/config reads and writes it through visit().
///
/// How a REFERENCE pose (pose_t) of such a log is to be read, so that evaluate needs no other channel:
///   validity  VALID where it may be scored (its fix type is one of score.fix_types, or it comes from no fix), else
///             INVALID; it is drawn all the same.
///   reason    kWithheld on a pose that comes from a fix (or has the time of one) which the GNSS channel was not given
///             (cut by a window or thinned out); empty otherwise.
///   q_wxyz    of the imu's axes as they are mounted, which evaluate turns estimates into; meaningful only where
///             reference.attitude says so (identity otherwise); velocity_mps likewise is in these axes with attitude and
///             in ENU axes without.
/// With reference.of == none and a GNSS channel, import writes the fixes themselves as REFERENCE, of the antenna
/// (origin ORIGIN_ANTENNA), and sets reference.from_fixes.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "samples/samples.h"

namespace roadfix {

/// The point of the vehicle that the reference's positions are of.
enum class ReferenceOf { kImu, kRearAxle, kAntenna, kCamera, kNone };

/// REFERENCE pose_t::reason of a fix that the estimators did not get.
inline constexpr const char* kWithheld = "withheld";

struct ReferenceFacts {
  ReferenceOf of = ReferenceOf::kNone;
  bool attitude = false;    ///< the reference carries orientation
  bool velocity = false;    ///< the reference carries velocity
  bool from_fixes = false;  ///< the reference is the receiver's own fixes: only withheld ones are independent
  double sigma_m = 0.0;     ///< standard deviation of each axis of the reference's positions
  /// rad, roll, pitch, yaw of the imu's axes in the vehicle's (geometry/euler.h), where they are known for sure: of a
  /// simulation. Absent: a filter's estimate turns its poses into the reference's axes.
  std::optional<Eigen::Vector3d> mounting = std::nullopt;
};

struct ScoreFacts {
  double skip_s = 0.0;             ///< not scored: this long after the first fix
  std::vector<FixType> fix_types;  ///< only these are scored; empty: all
};

/// GNSS fixes that import left out on purpose, one gap.
struct Outage {
  int64_t first_withheld_us = 0;  ///< utime of the first fix withheld
  int64_t last_withheld_us = 0;   ///< utime of the last one: the error of the outage is the error here
  int64_t return_us = 0;          ///< utime of the first fix given again; last_withheld_us where none follows
};

struct DriveFacts {
  std::string name;
  int64_t first_fix_us = 0;  ///< utime of the first fix of the drive, cut or not; of the first reference without GNSS
  ReferenceFacts reference;
  ScoreFacts score;
  std::vector<Outage> outages;       ///< in order of time
  bool score_withheld_only = false;  ///< fixes were thinned out: of a reference that is made of fixes, score the
                                     ///< withheld ones alone
};

template <class Visitor>
void visit(ReferenceFacts& f, Visitor& v) {
  v.choice("of", f.of,
           {{"imu", ReferenceOf::kImu},
            {"rear_axle", ReferenceOf::kRearAxle},
            {"antenna", ReferenceOf::kAntenna},
            {"camera", ReferenceOf::kCamera},
            {"none", ReferenceOf::kNone}});
  v.boolean("attitude", f.attitude);
  v.boolean("velocity", f.velocity);
  v.boolean("from_fixes", f.from_fixes);
  v.number("sigma_m", f.sigma_m, 0.0, 100.0);
  v.optional_vector("mounting_rad", f.mounting, -3.2, 3.2);
}

template <class Visitor>
void visit(ScoreFacts& f, Visitor& v) {
  v.number("skip_s", f.skip_s, 0.0, 1e6);
  v.choices("fix_types", f.fix_types,
            {{"none", FixType::kNone},
             {"single", FixType::kSingle},
             {"differential", FixType::kDifferential},
             {"rtk_float", FixType::kRtkFloat},
             {"rtk_fixed", FixType::kRtkFixed},
             {"dead_reckoning", FixType::kDeadReckoning}});
}

template <class Visitor>
void visit(Outage& f, Visitor& v) {
  v.integer("first_withheld_us", f.first_withheld_us, INT64_MIN, INT64_MAX);
  v.integer("last_withheld_us", f.last_withheld_us, INT64_MIN, INT64_MAX);
  v.integer("return_us", f.return_us, INT64_MIN, INT64_MAX);
}

/// Beyond the contract's visitor: choices(key, std::vector<Enum>&, names) and groups(key, std::vector<T>&), a sequence
/// of nested structs.
template <class Visitor>
void visit(DriveFacts& f, Visitor& v) {
  v.text("name", f.name);
  v.integer("first_fix_us", f.first_fix_us, INT64_MIN, INT64_MAX);
  v.group("reference", f.reference);
  v.group("score", f.score);
  v.groups("outages", f.outages);
  v.boolean("score_withheld_only", f.score_withheld_only);
}

}  // namespace roadfix
