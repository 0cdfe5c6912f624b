/// Which pose POSE_FUSED is: the INS's while that is healthy, and where it is not, the last one that was trusted, carried on by
/// the channel that leads (MODEL.md, section 6).
#pragma once

#include <array>
#include <optional>
#include <string>

#include "fusion/local_motion.h"
#include "fusion/witnesses.h"

namespace roadfix {

class Failover {
 public:
  explicit Failover(const FusionConfig& config) : config_(config) {}

  void start(const CarriedPose& local) { pose_ = local; }
  void set_gnss(int64_t t_us, bool present);

  /// After `channels` and `local` took in a sample of channel c, a valid one if `fresh`.
  void add(FusionChannel c, bool fresh, const Channels& channels, const LocalMotion& local, int64_t t_us);
  /// After an epoch: whether the witnesses condemn the INS; `clear`: nobody contradicts it.
  void judge(bool condemned, bool clear, const Channels& channels, int64_t t_us);

  [[nodiscard]] bool follows() const { return follows_; }
  [[nodiscard]] bool enu() const { return enu_; }
  [[nodiscard]] bool gnss() const { return gnss_; }
  /// s for which fixes have aided the INS.
  [[nodiscard]] double gnss_for(int64_t t_us) const { return gnss_ ? seconds_between(gnss_since_us_, t_us) : 0.0; }
  /// Why it does not follow the INS; empty where it does, or never did.
  [[nodiscard]] const std::string& why() const { return why_; }
  /// Where it does not follow; of the last INS sample where it does.
  [[nodiscard]] const CarriedPose& pose() const { return pose_; }
  /// Whether a correction of the INS's pose, in its frame, is one that it may not make without a fix.
  [[nodiscard]] bool implausible(const Planar& correction, const Eigen::Matrix3d& P) const;

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.pose_, self.trusted_, self.epochs_, self.witness_, self.follows_, self.ever_, self.enu_, self.gnss_,
          self.contradicted_, self.gnss_since_us_, self.good_since_us_, self.why_);
  }

 private:
  void carry(FusionChannel c, bool fresh, const Channels& channels, const LocalMotion& local, int64_t t_us);
  void stop(const char* why);
  [[nodiscard]] bool readmits(const PoseChannel& ins, const Channels& channels, const LocalMotion& local,
                              int64_t t_us) const;
  void take_over(const PoseChannel& ins);

  FusionConfig config_;
  CarriedPose pose_;
  /// Poses of the INS that nobody contradicted, older and newer, carried on by the best witness.
  std::array<CarriedPose, 2> trusted_;
  int epochs_ = 0;  ///< since the newer one began
  std::optional<FusionChannel> witness_;
  bool follows_ = false;
  bool ever_ = false;
  bool enu_ = false;
  bool gnss_ = false;
  bool contradicted_ = false;  ///< that is why it does not follow
  int64_t gnss_since_us_ = 0;
  std::optional<int64_t> good_since_us_;  ///< of the INS
  std::string why_;
};

}  // namespace roadfix
