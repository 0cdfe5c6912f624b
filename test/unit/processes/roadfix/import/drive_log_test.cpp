// A drive log holds the source's samples, in order and numbered, and all that an evaluation needs.
#include "roadfix/import/drive_log.h"

#include <catch2/catch.hpp>
#include <map>
#include <roadfix/config_t.hpp>
#include <set>

#include "bus/log/log_reader.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "roadfix/import/drive_folder.h"
#include "roadfix/import/drive_messages.h"
#include "small_drive.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

struct Event {
  std::string channel;
  int64_t timestamp_us;
  std::vector<uint8_t> bytes;
};

std::vector<Event> events_of(const fs::path& path) {
  std::vector<Event> events;
  LogReader reader(path);
  while (const auto event = reader.next()) {
    events.push_back({std::string(event->channel), event->timestamp_us, {event->data.begin(), event->data.end()}});
  }
  CHECK(reader.damage().empty());
  return events;
}

template <class T>
std::vector<T> messages_of(const std::vector<Event>& events, const std::string& channel) {
  std::vector<T> messages;
  for (const Event& event : events) {
    if (event.channel == channel) messages.push_back(decode<T>(event.bytes));
  }
  return messages;
}

class SmallDrive {
 public:
  SmallDrive() { test::write_small_drive(folder_.path()); }
  [[nodiscard]] fs::path path() const { return folder_.path(); }
  std::vector<Event> log(const ImportChanges& changes = {}, const char* name = "out.lcm") {
    write_drive_log(read_drive_folder(folder_.path()), changes, folder_.path() / name, {});
    return events_of(folder_.path() / name);
  }

 private:
  test::TemporaryFolder folder_;
};

DriveFacts facts_of(const std::vector<Event>& events) {
  const auto configs = messages_of<config_t>(events, "CONFIG_DRIVE");
  REQUIRE(configs.size() == 1);
  return parse_config<DriveFacts>(configs[0].config_yaml, "CONFIG_DRIVE");
}

TEST_CASE("a log has every sensor in order of time and numbered without gaps") {
  SmallDrive drive;
  const auto events = drive.log();
  std::map<std::string, int64_t> counts;
  for (std::size_t i = 0; i < events.size(); ++i) {
    const auto header = read_header(events[i].bytes);
    REQUIRE(header.has_value());
    CHECK(header->utime == events[i].timestamp_us);
    CHECK(header->run == test::kSmallDriveStart);
    CHECK(header->seq == counts[events[i].channel]++);
    if (i > 0) CHECK(events[i].timestamp_us >= events[i - 1].timestamp_us);
  }
  const std::map<std::string, int64_t> expected = {{"CAMERA_LEFT", 2}, {"CAMERA_RIGHT", 2}, {"CONFIG_DRIVE", 1},
                                                   {"GNSS", 12},       {"IMU", 60},         {"MAG", 30},
                                                   {"REFERENCE", 12},  {"WHEELS", 30}};
  CHECK(counts == expected);
  CHECK(events.front().channel == "CONFIG_DRIVE");
}

TEST_CASE("messages carry the source's values") {
  SmallDrive drive;
  const auto events = drive.log();
  const auto imu = messages_of<imu_t>(events, "IMU").at(3);
  CHECK(imu.gyro_radps[2] == 0.1);
  CHECK(imu.accel_mps2[0] == 0.03);
  const auto gnss = messages_of<gnss_t>(events, "GNSS").at(2);
  CHECK(gnss.fix_type == gnss_t::FIX_RTK_FLOAT);
  CHECK(gnss.height_kind == gnss_t::HEIGHT_ELLIPSOID);
  CHECK(gnss.lat_deg == Approx(48.100045).epsilon(1e-14));
  CHECK(gnss.cov_enu_m2[1][1] == Approx(0.0004));
  CHECK(gnss.velocity_enu_mps[1] == 10.0);
  CHECK(gnss.heading_deg == Approx(2.5));
  CHECK(gnss.num_satellites == 12);
  const auto wheels = messages_of<wheels_t>(events, "WHEELS").at(0);
  CHECK(wheels.num_speeds == 4);
  CHECK(wheels.speed_mps[3] == 10.05);
  CHECK(wheels.direction == wheels_t::DIRECTION_UNKNOWN);
  CHECK(messages_of<mag_t>(events, "MAG").at(0).field_ut[2] == Approx(-42.5));
  const auto image = messages_of<image_t>(events, "CAMERA_RIGHT").at(1);
  CHECK(image.format == image_t::FORMAT_PNG);
  CHECK(image.width_px == 4);
  CHECK(image.height_px == 2);
  CHECK(std::string(image.data.begin(), image.data.end()) == test::read_file(drive.path() / "images/r1.png"));
}

TEST_CASE("the reference is in one ENU frame with its attitude turned there") {
  SmallDrive drive;
  const auto poses = messages_of<pose_t>(drive.log(), "REFERENCE");
  REQUIRE(poses.size() == 12);
  CHECK(poses[0].frame == pose_t::FRAME_ENU);
  CHECK(poses[0].origin == pose_t::ORIGIN_IMU);
  CHECK(poses[0].anchor_lat_deg == Approx(48.1).epsilon(1e-14));
  CHECK(poses[0].position_m[1] == Approx(0.0).margin(1e-6));
  CHECK(poses[11].position_m[1] == Approx(11 * 2.25e-5 * kDegree * 6.378e6).epsilon(0.01));
  CHECK(poses[0].velocity_mps[0] == Approx(10.0));  // north at 90 deg from east, which is where x points
  CHECK(poses[0].cov_pose_m2_rad2[0][0] == Approx(1e-4));
  CHECK(poses[2].validity == pose_t::VALIDITY_INVALID);  // the fix of its time is rtk_float
  CHECK(poses[3].validity == pose_t::VALIDITY_VALID);
}

TEST_CASE("attitude far from the anchor is turned by the meridians' angle") {
  const Geodetic anchor{60.0 * kDegree, 10.0 * kDegree, 0.0};
  ReferencePoint point{
      1, {60.0 * kDegree, 11.0 * kDegree, 0.0}, Eigen::Vector3d(0.0, 10.0, 0.0), Eigen::Quaterniond::Identity()};
  const pose_t pose = to_message(point, EnuAnchor(anchor), ReferenceOf::kImu, 0.0);
  const Eigen::Quaterniond q(pose.q_wxyz[0], pose.q_wxyz[1], pose.q_wxyz[2], pose.q_wxyz[3]);
  const double yaw = 2.0 * std::atan2(q.z(), q.w());
  CHECK(std::abs(yaw) == Approx(std::sin(60.0 * kDegree) * kDegree).epsilon(0.02));
  CHECK(pose.velocity_mps[1] == Approx(10.0));  // vehicle axes: no turn
}

TEST_CASE("facts say what was cut and which poses are of withheld fixes") {
  SmallDrive drive;
  // 12 fixes in 2.75 s are too few for the margin at the end: make them 1 s apart.
  std::string gnss = test::read_file(drive.path() / "gnss.csv");
  std::string reference = test::read_file(drive.path() / "reference.csv");
  for (std::string* text : {&gnss, &reference}) {
    for (int i = 11; i > 0; --i) {
      const std::string from = std::to_string(test::kSmallDriveStart + 250000 * i);
      text->replace(text->find(from), from.size(), std::to_string(test::kSmallDriveStart + 1000000 * i));
    }
  }
  test::write_file(drive.path() / "gnss.csv", gnss);
  test::write_file(drive.path() / "reference.csv", reference);
  ImportChanges changes;
  changes.gnss.cut = CutGnss{2.0, 100.0, 3.0, 0.0};
  changes.score_skip = 2.5;
  const auto events = drive.log(changes);
  const DriveFacts facts = facts_of(events);
  CHECK(facts.name == "small");
  CHECK(facts.first_fix_us == test::kSmallDriveStart);
  CHECK(facts.score.skip_s == 2.5);
  CHECK(facts.score.fix_types == std::vector<FixType>{FixType::kRtkFixed});
  CHECK(facts.reference.attitude);
  CHECK(facts.reference.velocity);
  CHECK_FALSE(facts.reference.from_fixes);  // 1 m lower than the fixes
  REQUIRE(facts.outages.size() == 1);
  CHECK(facts.outages[0].first_withheld_us == test::kSmallDriveStart + 3000000);
  CHECK(facts.outages[0].last_withheld_us == test::kSmallDriveStart + 4000000);
  CHECK(facts.outages[0].return_us == test::kSmallDriveStart + 5000000);
  CHECK(messages_of<gnss_t>(events, "GNSS").size() == 10);
  const auto poses = messages_of<pose_t>(events, "REFERENCE");
  REQUIRE(poses.size() == 12);
  for (std::size_t i = 0; i < poses.size(); ++i) CHECK(poses[i].reason == (i == 3 || i == 4 ? kWithheld : ""));
}

TEST_CASE("without a reference the fixes are the reference") {
  SmallDrive drive;
  fs::remove(drive.path() / "reference.csv");
  std::string yaml = test::read_file(drive.path() / "drive.yaml");
  yaml.replace(yaml.find("reference: {of: imu, attitude: true"), 35, "reference: {of: none, attitude: false");
  test::write_file(drive.path() / "drive.yaml", yaml);
  ImportChanges changes;
  changes.gnss.keep_every = 4;
  const auto events = drive.log(changes);
  const DriveFacts facts = facts_of(events);
  CHECK(facts.reference.of == ReferenceOf::kAntenna);
  CHECK(facts.reference.from_fixes);
  CHECK_FALSE(facts.reference.attitude);
  CHECK(facts.score_withheld_only);
  const auto poses = messages_of<pose_t>(events, "REFERENCE");
  CHECK(poses.size() == 12);
  CHECK(poses[1].reason == kWithheld);
  CHECK(poses[4].reason.empty());
  CHECK(poses[0].origin == pose_t::ORIGIN_ANTENNA);
  CHECK(poses[0].velocity_mps[1] == Approx(10.0));  // ENU axes without attitude
  CHECK(messages_of<gnss_t>(events, "GNSS").size() == 3);
}

TEST_CASE("a reference that repeats the fixes is known as such") {
  SmallDrive drive;
  std::string reference = test::read_file(drive.path() / "reference.csv");
  for (auto at = reference.find("499.25"); at != std::string::npos; at = reference.find("499.25")) {
    reference.replace(at, 6, "500.25");
  }
  test::write_file(drive.path() / "reference.csv", reference);
  CHECK(facts_of(drive.log()).reference.from_fixes);
}

TEST_CASE("sensors and the start can be left out") {
  SmallDrive drive;
  ImportChanges changes;
  changes.without = {"wheels", "camera"};
  changes.start_after = 1.0;
  const auto events = drive.log(changes);
  std::set<std::string> channels;
  for (const Event& event : events) {
    channels.insert(event.channel);
    CHECK(event.timestamp_us >= test::kSmallDriveStart + 1000000);
  }
  CHECK(channels == std::set<std::string>{"CONFIG_DRIVE", "GNSS", "IMU", "MAG", "REFERENCE"});
  CHECK(facts_of(events).first_fix_us == test::kSmallDriveStart + 1000000);
  changes.without = {"radar"};
  CHECK_THROWS_WITH(drive.log(changes), Catch::Contains("--without radar: must be of imu, gnss"));
  changes.without = {};
  changes.start_after = 1000.0;
  CHECK_THROWS_WITH(drive.log(changes), Catch::Contains("nothing is left of the drive"));
}

TEST_CASE("the same source gives the same bytes") {
  SmallDrive drive;
  drive.log({}, "a.lcm");
  drive.log({}, "b.lcm");
  CHECK(test::read_file(drive.path() / "a.lcm") == test::read_file(drive.path() / "b.lcm"));
}

TEST_CASE("a log that cannot be finished does not appear") {
  SmallDrive drive;
  test::write_file(drive.path() / "images/l1.png", "no picture");
  CHECK_THROWS_WITH(drive.log(), Catch::Contains("l1.png: is neither a JPEG nor a PNG picture"));
  CHECK_FALSE(fs::exists(drive.path() / "out.lcm"));
  CHECK_FALSE(fs::exists(drive.path() / "out.lcm.part"));
}

TEST_CASE("a vehicle's calibration is written once and never silently replaced") {
  SmallDrive drive;
  const fs::path vehicle = drive.path() / "configs" / "small";
  Calibration calibration = read_drive_folder(drive.path()).description.calibration;
  write_vehicle(calibration, "small", vehicle, false);
  CHECK(calibration_text(load_calibration(vehicle)) == calibration_text(calibration));
  CHECK_NOTHROW(write_vehicle(calibration, "small", vehicle, false));
  calibration.sensors.gnss->rate = 5.0;
  CHECK_THROWS_WITH(write_vehicle(calibration, "small", vehicle, false),
                    Catch::Contains("is there already and differs"));
  write_vehicle(calibration, "small", vehicle, true);
  CHECK(load_calibration(vehicle).sensors.gnss->rate == 5.0);
}

}  // namespace
}  // namespace roadfix
