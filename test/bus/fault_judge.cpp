// Listens to the live stack and judges afterwards how it bore its faults: fault_judge URL EVENTS, ended by SIGINT.
//
// A line of EVENTS, which is read at the end: NAME BEGIN_US END_US REASONS, REASONS a regular expression over HEALTH's
// reason keys. Printed is a line of name=value for each of them, about the time until the next one begins (the last one
// only ends the one before):
//   verdict_s    from the beginning to the first HEALTH with such a reason that did not hold before (- where none came)
//   recovery_s   from the end to the first HEALTH from which on no new reason holds (- where some stay)
//   came         whether such a reason came at all before the drive's end;    stayed   new reasons of this time that were
//   never gone again after the fault's end
//   silent_s     longest time between two POSE_FUSED;    unusable_s   longest time without one that is not invalid
//   jump_m       largest step of usable poses beside their velocity that no reset tells;    error_m   largest
//   horizontal error of usable poses sigmas       the largest such error in standard deviations where it is over
//   kHonest_m;    false_valid   usable poses that are none (no
//                number, no unit quaternion, a negative variance)
// and then "ledger PROCESS CHANNEL KIND COUNT", what the stages' ledgers hold together.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <limits>
#include <regex>
#include <roadfix/health_t.hpp>
#include <roadfix/ledger_t.hpp>
#include <roadfix/pose_t.hpp>
#include <set>
#include <sstream>

#include "bus/run/run_process.h"
#include "bus/sample_codec.h"
#include "bus/transport/network_bus.h"
#include "bus/types/schema.h"
#include "geodesy/enu_change.h"
#include "geometry/frames.h"

namespace {

using namespace roadfix;

constexpr double kHonest_m = 0.5;  ///< an error below this is nobody's loss, whatever was claimed
constexpr int64_t kForgedRun = 1;  ///< test/bus/forged.h

struct Told {
  int64_t at_us = 0;
  std::set<std::string> keys;
};

struct Pose {
  int64_t at_us = 0;
  int64_t run = 0;
  int32_t reset_counter = 0;
  Odometry odometry;
  bool in_enu = true;  ///< in a local frame it says nothing of the place
  bool is_pose = true;

  [[nodiscard]] bool claims() const { return odometry.validity != Validity::kInvalid; }
  [[nodiscard]] bool usable() const { return claims() && in_enu; }
};

struct Fault {
  std::string name;
  int64_t begin_us = 0, end_us = 0;
  std::regex expected;
};

double seconds(int64_t us) { return static_cast<double>(us) * 1e-6; }

bool is_pose(const Odometry& o) {
  return o.T_frame_vehicle.p.allFinite() && std::abs(o.T_frame_vehicle.q.norm() - 1.0) < 1e-6 &&
         o.velocity.allFinite() && o.cov_pose.allFinite() && o.cov_pose.diagonal().minCoeff() >= 0.0;
}

class Judge {
 public:
  explicit Judge(NetworkBus& bus) {
    take<health_t>(bus, "HEALTH", [this](const health_t& m, int64_t at_us, const std::string&) {
      Told told{at_us, {}};
      for (std::string key : m.reason_key) {
        std::replace(key.begin(), key.end(), ' ', '_');
        told.keys.insert(key);
      }
      told_.push_back(std::move(told));
    });
    take<pose_t>(bus, "POSE_FUSED|REFERENCE", [this](const pose_t& m, int64_t at_us, const std::string& channel) {
      Pose pose{at_us, m.run, m.reset_counter, in_one_frame(m), m.frame == pose_t::FRAME_ENU, true};
      pose.is_pose = is_pose(pose.odometry);
      (channel == "REFERENCE" ? reference_ : fused_).push_back(pose);
    });
    take<ledger_t>(bus, "LEDGER_.*", [this](const ledger_t& m, int64_t, const std::string& channel) {
      for (const ledger_entry_t& e : m.entries) {
        if (!entries_.insert({channel, m.run, e.entry}).second) continue;
        counts_[{channel, e.channel, e.kind}] += std::max<int64_t>(1, e.last_seq - e.first_seq + 1);
      }
    });
  }

  void print(const Fault& fault, int64_t until_us) const {
    std::cout << "name=" << fault.name;
    print_health(fault, until_us);
    print_poses(fault.begin_us, until_us);
    std::cout << "\n";
  }

  void print_ledgers() const {
    constexpr std::array<const char*, 8> kKinds = {"lost",    "late",          "undecodable", "refused",
                                                   "skipped", "clock_changed", "run_began",   "unused_feedback"};
    for (const auto& [key, count] : counts_) {
      const auto& [process, channel, kind] = key;
      std::cout << "ledger " << process << " " << channel << " " << kKinds.at(static_cast<std::size_t>(kind)) << " "
                << count << "\n";
    }
  }

 private:
  template <class T, class Handle>
  void take(NetworkBus& bus, const std::string& channels, Handle handle) {
    const MessageCheck check = Schema::built_in().check_of(T::getTypeName());
    bus.subscribe(channels, [check, handle](const BusMessage& message) {
      if (check(message.bytes) != CheckResult::kOk || read_header(message.bytes)->run == kForgedRun) return;
      handle(decode<T>(message.bytes), message.received_us, std::string(message.channel));
    });
  }

  Odometry in_one_frame(const pose_t& m) {
    Odometry o = odometry(m);
    const Geodetic anchor{m.anchor_lat_deg * kDegree, m.anchor_lon_deg * kDegree, m.anchor_height_m};
    if (m.frame != pose_t::FRAME_ENU || m.validity == pose_t::VALIDITY_INVALID) return o;
    if (!anchor_) anchor_ = anchor;
    if (!same_anchor(*anchor_, anchor)) o.T_frame_vehicle = T_enu_enu(*anchor_, anchor) * o.T_frame_vehicle;
    return o;
  }

  void print_health(const Fault& fault, int64_t until_us) const {
    constexpr int64_t kBefore_us = 1'000'000;
    std::set<std::string> before, news;
    std::optional<double> verdict_s;
    double recovery_s = 0.0;
    bool open = false;
    const Told* last = nullptr;
    for (const Told& told : told_) {
      if (told.at_us < fault.begin_us) {
        if (last != nullptr && told.at_us > fault.begin_us - kBefore_us)
          before.insert(last->keys.begin(), last->keys.end());
        last = &told;
        continue;
      }
      if (last != nullptr) before.insert(last->keys.begin(), last->keys.end());
      last = nullptr;
      if (told.at_us >= until_us) break;
      bool any = false;
      for (const std::string& key : told.keys) {
        if (before.contains(key)) continue;
        any = true;
        news.insert(key);
        if (!verdict_s && std::regex_match(key, fault.expected)) verdict_s = seconds(told.at_us - fault.begin_us);
      }
      if (open && !any) recovery_s = std::max(0.0, seconds(told.at_us - fault.end_us));
      open = any;
    }
    print_order(fault, before, news);
    std::cout << " verdict_s=" << (verdict_s ? std::to_string(*verdict_s) : "-")
              << " recovery_s=" << (open ? "-" : std::to_string(recovery_s)) << " reasons=";
    for (const std::string& key : news) std::cout << key << ",";
    std::cout << " before=";
    for (const std::string& key : before) std::cout << key << ",";
  }

  /// What holds however slowly everything runs: whether an expected reason ever came after the beginning, and which of
  /// the new reasons was never gone again after the end, until the drive's.
  void print_order(const Fault& fault, const std::set<std::string>& before, std::set<std::string> news) const {
    bool came = false;
    std::set<std::string> seen, gone;
    for (const Told& told : told_) {
      if (told.at_us < fault.begin_us) continue;
      for (const std::string& key : told.keys) {
        const bool expected = !before.contains(key) && std::regex_match(key, fault.expected);
        came = came || expected;
        if (expected) news.insert(key);
        seen.insert(key);
      }
      if (told.at_us < fault.end_us) continue;
      for (const std::string& key : seen)
        if (!told.keys.contains(key)) gone.insert(key);
    }
    std::cout << " came=" << came << " stayed=";
    for (const std::string& key : news)
      if (!gone.contains(key)) std::cout << key << ",";
  }

  void print_poses(int64_t from_us, int64_t until_us) const {
    double silent_s = 0.0, unusable_s = 0.0, jump_m = 0.0, error_m = 0.0, sigmas = 0.0;
    int false_valid = 0, poses = 0;
    const Pose* last = nullptr;
    int64_t heard_us = from_us, usable_us = from_us;
    for (const Pose& pose : fused_) {
      if (pose.at_us < from_us) last = &pose;
      if (pose.at_us < from_us || pose.at_us >= until_us) continue;
      ++poses;
      silent_s = std::max(silent_s, seconds(pose.at_us - heard_us));
      heard_us = pose.at_us;
      if (pose.claims()) false_valid += pose.is_pose ? 0 : 1;
      if (pose.usable()) {
        unusable_s = std::max(unusable_s, seconds(pose.at_us - usable_us));
        usable_us = pose.at_us;
        jump_m = std::max(jump_m, jump(last, pose));
        measure(pose, error_m, sigmas);
      }
      last = &pose;
    }
    silent_s = std::max(silent_s, seconds(until_us - heard_us));
    unusable_s = std::max(unusable_s, seconds(until_us - usable_us));
    std::cout << " poses=" << poses << " silent_s=" << silent_s << " unusable_s=" << unusable_s << " jump_m=" << jump_m
              << " error_m=" << error_m << " sigmas=" << sigmas << " false_valid=" << false_valid;
  }

  static double jump(const Pose* last, const Pose& pose) {
    if (last == nullptr || !last->usable() || last->run != pose.run || last->reset_counter != pose.reset_counter)
      return 0.0;
    const Odometry &a = last->odometry, &b = pose.odometry;
    const double dt_s = seconds(b.t_us - a.t_us);
    if (dt_s <= 0.0 || dt_s > 0.5) return 0.0;
    const Eigen::Vector3d mean = 0.5 * (a.T_frame_vehicle.q * a.velocity + b.T_frame_vehicle.q * b.velocity);
    return (b.T_frame_vehicle.p - a.T_frame_vehicle.p - mean * dt_s).norm();
  }

  /// Against the reference of the same stamp that came at about the same time: stamps may have been stepped.
  void measure(const Pose& pose, double& error_m, double& sigmas) const {
    constexpr int64_t kAround_us = 2'000'000, kMaxStep_us = 250'000;
    const auto first = std::lower_bound(reference_.begin(), reference_.end(), pose.at_us - kAround_us,
                                        [](const Pose& reference, int64_t at_us) { return reference.at_us < at_us; });
    for (auto b = first; b != reference_.end() && b->at_us < pose.at_us + kAround_us; ++b) {
      if (b == reference_.begin()) continue;
      const auto a = std::prev(b);
      const int64_t t0 = a->odometry.t_us, t1 = b->odometry.t_us, t = pose.odometry.t_us;
      if (t < t0 || t > t1 || t1 <= t0 || t1 - t0 > kMaxStep_us) continue;
      const double share = static_cast<double>(t - t0) / static_cast<double>(t1 - t0);
      const Eigen::Vector3d truth =
          (1.0 - share) * a->odometry.T_frame_vehicle.p + share * b->odometry.T_frame_vehicle.p;
      const Eigen::Vector2d error = (pose.odometry.T_frame_vehicle.p - truth).head<2>();
      const Eigen::Matrix2d P = pose.odometry.cov_pose.topLeftCorner<2, 2>();
      error_m = std::max(error_m, error.norm());
      if (error.norm() > kHonest_m) sigmas = std::max(sigmas, std::sqrt(error.dot(P.inverse() * error)));
      return;
    }
  }

  std::vector<Told> told_;
  std::vector<Pose> fused_, reference_;
  std::optional<Geodetic> anchor_;
  std::set<std::tuple<std::string, int64_t, int64_t>> entries_;
  std::map<std::tuple<std::string, std::string, int>, int64_t> counts_;
};

std::vector<Fault> read_events(const char* path) {
  std::vector<Fault> faults;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    Fault fault;
    std::string expected;
    if (!(words >> fault.name >> fault.begin_us >> fault.end_us >> expected))
      throw std::runtime_error("no event: " + line);
    fault.expected = expected;
    faults.push_back(std::move(fault));
  }
  return faults;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  try {
    NetworkBus bus(argv[1]);
    Judge judge(bus);
    catch_stop_signals();
    while (!stop_requested()) bus.handle(std::chrono::milliseconds(100));
    const std::vector<Fault> faults = read_events(argv[2]);
    for (std::size_t i = 0; i + 1 < faults.size(); ++i) {
      judge.print(faults[i], faults[i + 1].begin_us);
    }
    judge.print_ledgers();
  } catch (const std::exception& e) {
    std::cerr << "fault_judge: " << e.what() << "\n";
    return 2;
  }
  return 0;
}
