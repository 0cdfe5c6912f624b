#include <catch2/catch.hpp>
#include <sstream>

#include "evaluation/map_formats.h"
#include "evaluation/trajectory_formats.h"
#include "geometry/frames.h"
#include "unit/evaluation/synthetic.h"

namespace roadfix {
namespace {

const Geodetic kAnchor{0.85, 0.15, 420.0};
constexpr int64_t kStart = 1'752'003'258'499'123;

Trajectory sample() {
  Trajectory trajectory = test::eight_trajectory(0.0, 10.0, 1.0);
  for (Odometry& pose : trajectory.poses) {
    pose.t_us += kStart;
    pose.cov_pose.diagonal() << 0.04, 0.09, 0.16, 1e-4, 4e-4, 9e-4;
  }
  trajectory.poses[3].validity = Validity::kInvalid;
  return trajectory;
}

TEST_CASE("TUM reads back to the nanometre and the microsecond") {
  std::stringstream stream;
  const Trajectory trajectory = sample();
  write_tum(stream, trajectory);
  int rows = 0;
  for (const Odometry& pose : trajectory.poses) {
    if (pose.validity == Validity::kInvalid) continue;
    std::string time;
    Eigen::Vector3d p;
    Eigen::Quaterniond q;
    stream >> time >> p.x() >> p.y() >> p.z() >> q.x() >> q.y() >> q.z() >> q.w();
    const auto point = time.find('.');
    CHECK(std::stoll(time.substr(0, point)) * 1'000'000 + std::stoll(time.substr(point + 1)) == pose.t_us);
    CHECK((p - pose.T_frame_vehicle.p).norm() < 2e-9);
    CHECK(log_q(q.normalized().conjugate() * pose.T_frame_vehicle.q).norm() < 1e-11);
    ++rows;
  }
  CHECK(rows == 10);
  std::string rest;
  CHECK_FALSE(stream >> rest);
}

TEST_CASE("KITTI reads back relative to the first pose") {
  std::stringstream stream;
  const Trajectory trajectory = sample();
  write_kitti(stream, trajectory);
  const SE3 T_first = trajectory.poses.front().T_frame_vehicle;
  for (const Odometry& pose : trajectory.poses) {
    if (pose.validity == Validity::kInvalid) continue;
    Eigen::Matrix<double, 3, 4> M;
    for (int i = 0; i < 12; ++i) stream >> M(i / 4, i % 4);
    const SE3 T{Eigen::Quaterniond(Eigen::Matrix3d(M.leftCols<3>())), M.col(3)};
    CHECK(local(T_first * T, pose.T_frame_vehicle).norm() < 1e-8);
  }
}

TEST_CASE("CSV has a column for each name and geodetic columns where there is an anchor") {
  std::stringstream stream;
  write_csv(stream, sample(), kAnchor);
  std::string header, row;
  std::getline(stream, header);
  std::getline(stream, row);
  const auto commas = [](const std::string& text) { return std::count(text.begin(), text.end(), ','); };
  CHECK(commas(header) == commas(row));
  CHECK(header.find("lat_deg,lon_deg,height_m") != std::string::npos);
  CHECK(row.find(",0.2,0.3,0.4,0.01,0.02,0.03,valid,") != std::string::npos);
  CHECK(row.substr(0, row.find(',')) == std::to_string(kStart));
  std::stringstream local_stream;
  write_csv(local_stream, sample(), std::nullopt);
  std::getline(local_stream, header);
  CHECK(header.find("lat_deg") == std::string::npos);
}

TEST_CASE("GeoJSON gives longitude before latitude, back to a millimetre") {
  std::stringstream stream;
  const Trajectory trajectory = sample();
  write_geojson(stream, trajectory, kAnchor, "POSE_TEST");
  const std::string text = stream.str();
  CHECK(std::count(text.begin(), text.end(), '{') == std::count(text.begin(), text.end(), '}'));
  const auto first = text.find("[\n[") + 3;
  std::istringstream numbers(text.substr(first));
  double longitude = 0.0, latitude = 0.0, height = 0.0;
  char comma = 0;
  numbers >> longitude >> comma >> latitude >> comma >> height;
  const Eigen::Vector3d p = EnuAnchor(kAnchor).enu({latitude * kDegree, longitude * kDegree, height});
  CHECK((p - trajectory.poses.front().T_frame_vehicle.p).norm() < 1e-3);
}

int count(const std::string& text, const std::string& word) {
  int n = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++n;
  return n;
}

/// The first number in `text` after `key`.
double number_behind(const std::string& text, const std::string& key) {
  return std::stod(text.substr(text.find(key) + key.size()));
}

TEST_CASE("GPX: a segment for each stretch with a position, and heights only above the sea") {
  Trajectory trajectory = sample();
  trajectory.poses.back().validity = Validity::kCoasting;
  const auto poses = static_cast<int>(trajectory.poses.size());
  std::stringstream known, unknown;
  write_gpx(known, trajectory, kAnchor, "A<&>", [](const Geodetic& g) { return SeaLevel{g.height - 46.0, 46.0}; });
  write_gpx(unknown, trajectory, kAnchor, "A<&>", [](const Geodetic&) { return SeaLevel{}; });
  const Geodetic place = EnuAnchor(kAnchor).geodetic(trajectory.poses.front().T_frame_vehicle.p);
  for (const std::string& text : {known.str(), unknown.str()}) {
    CHECK(count(text, "<trkseg>") == 2);  // an invalid pose lies between
    CHECK(count(text, "</trkseg>") == 2);
    CHECK(count(text, "<trkpt ") == poses - 1);
    CHECK(count(text, "<fix>none</fix>") == 1);
    CHECK(count(text, "<name>A&lt;&amp;&gt;</name>") == 1);
    CHECK(count(text, "<time>2025-07-08T19:34:18.499123Z</time>") == 1);
    CHECK(number_behind(text, "lat=\"") == Approx(place.latitude / kDegree).margin(1e-9));
    CHECK(number_behind(text, "lon=\"") == Approx(place.longitude / kDegree).margin(1e-9));
  }
  CHECK(number_behind(known.str(), "<ele>") == Approx(place.height - 46.0).margin(1e-3));
  CHECK(count(known.str(), "<geoidheight>46.000</geoidheight>") == poses - 1);
  CHECK(count(unknown.str(), "<ele>") == 0);
}

TEST_CASE("KML: a line for each stretch of one validity, on the ground where heights are unknown") {
  Trajectory trajectory = sample();
  for (std::size_t i = 6; i < 8; ++i) trajectory.poses[i].validity = Validity::kCoasting;
  std::stringstream known, unknown;
  write_kml(known, trajectory, kAnchor, "POSE", [](const Geodetic& g) { return SeaLevel{g.height, {}}; });
  write_kml(unknown, trajectory, kAnchor, "POSE", [](const Geodetic&) { return SeaLevel{}; });
  CHECK(count(known.str(), "<LineString>") == 4);  // valid, invalid, valid, coasting, valid
  CHECK(count(known.str(), "#coasting") == 1);
  CHECK(count(known.str(), "absolute") == 4);
  CHECK(count(unknown.str(), "clampToGround") == 4);
  const std::string text = unknown.str();
  const std::string first =
      text.substr(text.find("<coordinates>\n") + 14,
                  text.find('\n', text.find("<coordinates>\n") + 14) - text.find("<coordinates>\n") - 14);
  CHECK(std::count(first.begin(), first.end(), ',') == 1);
}

TEST_CASE("ISO times") {
  CHECK(iso_time(0) == "1970-01-01T00:00:00.000000Z");
  CHECK(iso_time(951'782'400'000'000) == "2000-02-29T00:00:00.000000Z");
  CHECK(iso_time(-1) == "1969-12-31T23:59:59.999999Z");
  CHECK(iso_time(kStart) == "2025-07-08T19:34:18.499123Z");
}

}  // namespace
}  // namespace roadfix
