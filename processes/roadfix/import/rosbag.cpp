#include "roadfix/import/rosbag.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/config_error.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "roadfix/import/ros_choice.h"
#include "roadfix/import/ros_frames.h"
#include "roadfix/import/sample_rate.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

class BagPictures : public PictureStore {
 public:
  BagPictures(std::shared_ptr<Bag> bag, const RosTopic& topic, std::string name)
      : bag_(std::move(bag)),
        type_(topic.topic().type, topic.topic().definition, topic.topic().encoding),
        raw_(topic.kind() == RosKind::kImage),
        pictures_(topic.pictures),
        name_(std::move(name)) {}

  std::vector<uint8_t> read(std::size_t index) override {
    const std::vector<uint8_t> message = bag_->data_at(pictures_.at(index).place);
    try {
      type_.decode(message, record_);
      const std::span<const uint8_t> data = field("data").bytes;
      if (!raw_) return {data.begin(), data.end()};
      return png_of({std::string(field("encoding").text), static_cast<int>(field("width").number),
                     static_cast<int>(field("height").number), static_cast<int64_t>(field("step").number), data.data(),
                     data.size()});
    } catch (const std::runtime_error& e) {
      throw ConfigError(name_, 0, fmt::format("picture {}: {}", index + 1, e.what()));
    }
  }

 private:
  [[nodiscard]] const RosValue& field(const char* name) const {
    const auto slot = type_.find(name);
    if (!slot) throw RosError(std::string("the type has no field ") + name);
    return record_.values[*slot];
  }

  std::shared_ptr<Bag> bag_;
  RosType type_;
  bool raw_;
  std::vector<RosPicture> pictures_;
  std::string name_;
  RosRecord record_;
};

/// Messages come in the order of recording; what a driver sent out of order is put into that of its stamps.
template <class T>
std::vector<T> in_order(std::vector<T> list) {
  std::stable_sort(list.begin(), list.end(), [](const T& a, const T& b) { return a.t_us < b.t_us; });
  return list;
}

class BagImporter {
 public:
  BagImporter(std::shared_ptr<Bag> bag, const fs::path& path, const std::vector<RosTopic>& topics, RosChoice choice)
      : bag_(std::move(bag)), path_(path), choice_(std::move(choice)), frames_(topics) {
    drive_.format = "rosbag";
    drive_.remarks = choice_.remarks;
    drive_.description.name = fs::weakly_canonical(path).stem().string();
    drive_.description.origin = "ROS bag";
    find_body();
  }

  Drive take() {
    take_imu();
    take_gnss();
    take_wheels();
    take_mag();
    take_camera("left", drive_.frames_left, sensors().camera_left);
    take_camera("right", drive_.frames_right, sensors().camera_right);
    take_reference();
    for (const auto& [role, topic] : choice_.by_role) say_of(role, *topic);
    return std::move(drive_);
  }

 private:
  SensorsCalibration& sensors() { return drive_.description.calibration.sensors; }
  void say(const std::string& text) { drive_.remarks.push_back(text); }

  /// Body: origin at the IMU, axes of the vehicle's frame where /tf_static has both, else the IMU's own.
  void find_body() {
    drive_.description.calibration.body_origin = BodyOrigin::kImu;
    const RosTopic* imu = choice_.find("imu");
    base_ = frames_.base();
    const auto T_base_imu = imu != nullptr && !base_.empty() ? frames_.find(base_, imu->frame) : std::nullopt;
    if (T_base_imu) {
      R_body_imu_ = T_base_imu->R();
      p_base_body_ = T_base_imu->p;
      const double angle = log_q(T_base_imu->q).norm();
      if (angle > 1e-3) {
        say(fmt::format("IMU turned by {:.1f} deg from {} into the axes of {}", angle * 180.0 / kPi, imu->frame,
                        base_));
      }
    } else if (imu != nullptr) {
      say(fmt::format(
          "/tf_static does not say how {} sits in the vehicle: its axes are taken as x forward, y left, z up",
          imu->frame.empty() ? "the IMU" : imu->frame));
      if (frames_.empty() || base_.empty()) base_ = imu->frame;
    }
  }

  /// A sensor's frame seen from the body, where transforms lead there.
  std::optional<SE3> T_body(const std::string& frame) const {
    if (base_.empty() || frame.empty()) return std::nullopt;
    auto T_base = frames_.find(base_, frame);
    if (T_base) T_base->p -= p_base_body_;
    return T_base;
  }

  void take_imu() {
    const RosTopic* topic = choice_.find("imu");
    if (topic == nullptr) return;
    drive_.imu = in_order(topic->imu);
    if (!R_body_imu_.isIdentity(1e-12)) {
      for (ImuSample& sample : drive_.imu) {
        sample.gyro = R_body_imu_ * sample.gyro;
        sample.accel = R_body_imu_ * sample.accel;
      }
    }
    sensors().imu = ImuCalibration{};
    sensors().imu->rate = rate_of(drive_.imu);
  }

  void take_gnss() {
    const RosTopic* topic = choice_.find("gnss");
    if (topic == nullptr) return;
    drive_.gnss = in_order(topic->gnss);
    sensors().gnss = GnssCalibration{};
    sensors().gnss->rate = rate_of(drive_.gnss);
    if (!drive_.gnss.empty()) sensors().gnss->height = drive_.gnss.front().height_kind;
    if (const auto T = T_body(topic->frame)) sensors().gnss->lever_arm = T->p;
    if (const RosTopic* velocity = choice_.find("gnss_velocity")) add_velocities(*velocity);
  }

  /// A receiver's velocity comes in messages of its own, in east, north, up: it joins the fix of its epoch.
  void add_velocities(const RosTopic& topic) {
    constexpr int64_t kSameEpoch_us = 50'000;
    const std::vector<RosTwist> twists = in_order(topic.twists);
    std::size_t joined = 0;
    for (GnssFix& fix : drive_.gnss) {
      const auto later = std::lower_bound(twists.begin(), twists.end(), fix.t_us - kSameEpoch_us,
                                          [](const RosTwist& twist, int64_t t_us) { return twist.t_us < t_us; });
      const RosTwist* best = nullptr;
      for (auto twist = later; twist != twists.end() && twist->t_us <= fix.t_us + kSameEpoch_us; ++twist) {
        if (best == nullptr || std::abs(twist->t_us - fix.t_us) < std::abs(best->t_us - fix.t_us)) best = &*twist;
      }
      if (best == nullptr) continue;
      fix.velocity = GnssVelocity{best->linear, best->cov_linear.value_or(Eigen::Matrix3d::Zero())};
      ++joined;
    }
    say(fmt::format("{}: {} of {} velocities, taken as east, north, up, join fixes", topic.topic().name, joined,
                    twists.size()));
  }

  void take_wheels() {
    const RosTopic* topic = choice_.find("wheels");
    if (topic == nullptr) return;
    const std::vector<RosTwist> twists = in_order(topic->twists);
    const bool turns =
        std::any_of(twists.begin(), twists.end(), [](const RosTwist& t) { return t.angular.z() != 0.0; });
    for (const RosTwist& twist : twists) {
      WheelSample sample;
      sample.t_us = twist.t_us;
      sample.direction = WheelDirection::kSigned;
      sample.speeds[0] = twist.linear.x();
      if (turns) sample.yaw_rate = twist.angular.z();
      drive_.wheels.push_back(sample);
    }
    if (!turns) say(fmt::format("{}: angular.z is always 0: no yaw rate", topic->topic().name));
    sensors().wheels = WheelsCalibration{};
    sensors().wheels->rate = rate_of(drive_.wheels);
    const std::string& frame = topic->child_frame.empty() ? topic->frame : topic->child_frame;
    if (const auto T = T_body(frame)) {
      sensors().wheels->lever_arm = T->p;
      say(fmt::format("wheels' speed is taken as that of {}", frame));
    }
  }

  void take_mag() {
    const RosTopic* topic = choice_.find("mag");
    if (topic == nullptr) return;
    drive_.mag = in_order(topic->mag);
    const auto T = T_body(topic->frame);
    for (MagSample& sample : drive_.mag) sample.field = T ? T->q * sample.field : sample.field;
    sensors().mag = MagCalibration{};
  }

  void take_camera(const std::string& side, std::vector<FrameFile>& frames, std::optional<CameraCalibration>& camera) {
    const RosTopic* topic = choice_.find("camera_" + side);
    if (topic == nullptr) return;
    const std::string& name = topic->topic().name;
    if (topic->kind() == RosKind::kImage && !is_known_encoding(topic->encoding)) {
      say(fmt::format("left out: {}: pictures of encoding '{}'", name, topic->encoding));
      return;
    }
    const auto store = std::make_shared<BagPictures>(bag_, *topic, path_.string() + ": topic " + name);
    for (std::size_t i = 0; i < topic->pictures.size(); ++i) {
      frames.push_back(
          {topic->pictures[i].t_us, fmt::format("{}: topic {}, picture {}", path_.string(), name, i + 1), store, i});
    }
    frames = in_order(std::move(frames));
    const RosTopic* info = choice_.find("camera_info_" + side);
    camera = info != nullptr ? info->camera : std::nullopt;
    if (!camera) {
      say(fmt::format("{}: no CameraInfo with a calibration that we have{}", name,
                      info != nullptr && !info->encoding.empty() ? " (" + info->encoding + ")" : ""));
      camera.emplace();
    } else if (name.find("rect") != std::string::npos) {
      camera->distortion = CameraDistortion{};
      say(fmt::format("{}: taken as rectified, by its name", name));
    }
    camera->rate = rate_of(frames);
    if (const auto T = T_body(topic->frame)) {
      camera->mounting = CameraMounting{T->p, {T->q.w(), T->q.x(), T->q.y(), T->q.z()}, std::nullopt, std::nullopt};
    } else {
      say(fmt::format("{}: /tf_static does not say where its camera sits", name));
    }
  }

  void take_reference() {
    const RosTopic* topic = choice_.find("reference");
    if (topic == nullptr) return;
    drive_.local_reference = in_order(topic->poses);
    const std::string& frame = topic->child_frame.empty() ? topic->frame : topic->child_frame;
    const auto T_body_child = T_body(frame);
    if (T_body_child && topic->kind() == RosKind::kOdometry) {
      const SE3 T_child_body = T_body_child->inverse();
      for (LocalPose& pose : drive_.local_reference) {
        pose.T_local_body = pose.T_local_body * T_child_body;
        pose.velocity_local.reset();  // of the child's origin, not of the body's
      }
    } else {
      say(fmt::format("{}: its poses are taken as those of the IMU", topic->topic().name));
    }
    drive_.description.reference = {ReferenceOf::kImu, true, 0.0};
  }

  void say_of(const std::string& role, const RosTopic& topic) {
    const std::string& name = topic.topic().name;
    if (topic.left_out > 0)
      say(fmt::format("{}: {} messages of {} without a value that counts left out", name, topic.left_out,
                      topic.messages));
    if (topic.without_stamp > 0 && role.find("info") == std::string::npos) {
      say(fmt::format("{}: {} messages without a stamp have the time of recording", name, topic.without_stamp));
    }
    if (topic.without_covariance > 0)
      say(fmt::format("{}: {} fixes without a covariance get 5 m, 10 m up", name, topic.without_covariance));
  }

  std::shared_ptr<Bag> bag_;
  fs::path path_;
  RosChoice choice_;
  RosFrames frames_;
  std::string base_;
  Eigen::Matrix3d R_body_imu_ = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_base_body_ = Eigen::Vector3d::Zero();
  Drive drive_;
};

}  // namespace

Drive read_rosbag(const fs::path& path, const std::map<std::string, std::string>& named) {
  const std::shared_ptr<Bag> bag = open_bag(path);
  std::vector<RosTopic> topics;
  bag->read([&](const BagMessage& message) {
    while (topics.size() <= message.topic) topics.emplace_back(bag->topics()[topics.size()], path.string());
    topics[message.topic].take(message);
  });
  Drive drive = BagImporter(bag, path, topics, choose_topics(topics, named, path.string())).take();
  if (drive.imu.empty() && drive.gnss.empty() && drive.wheels.empty() && drive.mag.empty() &&
      drive.frames_left.empty()) {
    std::string there;
    for (const BagTopic& topic : bag->topics())
      there += fmt::format("{}{} ({})", there.empty() ? "" : ", ", topic.name, topic.type);
    throw ConfigError(path.string(), 0,
                      "holds no sensor that we take: " + (there.empty() ? "it is empty" : "it has " + there));
  }
  return drive;
}

}  // namespace roadfix
